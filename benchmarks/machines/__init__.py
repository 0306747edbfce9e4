"""Three machines in the formats of Pgraph and its peers, as a user would write them."""
