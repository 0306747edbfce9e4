"""Random scenes whose motion is known, and the judge of what runs say of their own error."""
