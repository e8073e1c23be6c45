"""What is looked at beside the motion: extremes, named quantities, neglected bending."""
