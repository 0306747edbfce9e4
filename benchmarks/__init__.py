"""Speed of Pgraph against its peers, on the same models: `pgraph bench`."""
