"""Speed of Pgraph beside its peers, on the same models; run by hand."""
