"""Contact of a line with itself: pairs that are near, law, friction, the solve."""
