"""Speed of Pgraph beside its peers, on the same models: `pgraph bench`."""
