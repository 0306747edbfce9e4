"""Speed of Pgraph and its peers on the same models: `pgraph bench`."""
