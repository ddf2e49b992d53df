"""The search: one test on replicates, models grown and pruned by it, and those that cannot be told apart."""
