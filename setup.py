"""Which folder is which package; everything else about the distribution is in pyproject.toml."""

from setuptools import find_packages, setup

FOLDERS = {
    "pgraph_core": "pgraph_core",
    "pgraph_app": "app",
    "pgraph_models": "static_models",
    "pgraph_peers": "peers",
}

setup(
    package_dir=FOLDERS,
    packages=[
        name
        for package, folder in FOLDERS.items()
        for name in (package, *(f"{package}.{part}" for part in find_packages(folder)))
    ],
)
