"""Tours: who visits which tasks, in which order and when, so that all are home soon and nothing urgent waits."""
