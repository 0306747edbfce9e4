"""The paper's operators as pictures."""
