"""Newton's method, generalized alpha, step control, what follows an accepted step."""
