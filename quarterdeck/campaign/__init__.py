"""Many runs of one plan, on this machine or a cluster, and what they prove."""
