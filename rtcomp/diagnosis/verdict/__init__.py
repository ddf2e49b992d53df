"""What is said: verdict and names, numbers, what would have been seen, the next experiment, one judgement."""
