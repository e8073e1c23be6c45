"""The touchdown scene in other people's codes, so that ours can be measured against them.  Nothing here is a test."""
