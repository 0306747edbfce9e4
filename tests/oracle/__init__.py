"""Dense constraints and loads from the paper's operators: slow, plain, and only for tests."""
