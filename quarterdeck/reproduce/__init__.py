"""The studies that reproduce the four papers, a file each."""
