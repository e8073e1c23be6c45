"""Many runs: error against cost, and other programs on the same scene."""
