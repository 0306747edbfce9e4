"""Tests of Pgraph."""
