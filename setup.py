"""Map folders to packages, choose the dependencies, and adapt the README to package indexes.

Everything else about the distribution is in pyproject.toml. With PGRAPH_LEAN=1 in the environment
the distribution depends on the packages of the library alone, for servers and notebooks.
"""

import os
import re
import tomllib
from pathlib import Path
from tempfile import TemporaryDirectory

from setuptools import find_namespace_packages, setup

FOLDERS = {
    "pgraph_core": "pgraph_core",
    "pgraph_app": "app",
    "pgraph_models": "static_models",
    "pgraph_peers": "peers",
}
LIBRARY = [
    "numpy>=2.0",
    "scipy>=1.13",
    "llvmlite>=0.50",  # the archive of kernels is bitcode of its LLVM, which older ones cannot read
    "pydantic>=2.9",
]
REST = [
    "numba>=0.61,<0.69",  # compiles functions of the user, and kernels that the archive lacks
    "trimesh>=4.5",
    "viser==1.1.1",  # pinned: app/core/bridge.py knows names that viser does not document
    "websockets>=13",  # used by app/core/bridge.py; viser brings it
]
HERE = Path(__file__).parent
# [words](file) or ![words](file), but neither an address nor an index and a call in code
LINK = re.compile(r"(?<![\w\])])(!?)\[([^\]]*)\]\((?!https?://)([^)]+)\)")


def for_index(text: str, source: str | None) -> str:
    """Return the README with links that work outside the repository.

    Links to files lead to the repository at `source`. Without an address they become their text,
    and pictures are left out.
    """

    def link(found: re.Match[str]) -> str:
        picture, words, file = found.groups()
        if source is None:
            return "" if picture else words
        return f"{picture}[{words}]({source}/{'raw' if picture else 'blob'}/HEAD/{file})"

    return LINK.sub(link, text)


def main() -> None:
    """Hand everything to setuptools."""
    project = tomllib.loads((HERE / "pyproject.toml").read_text("utf-8"))["project"]
    readme = (HERE / "README.md").read_text("utf-8")
    lean = os.environ.get("PGRAPH_LEAN", "0") != "0"
    with TemporaryDirectory() as build:  # from one that stays, setuptools ships deleted files, too
        setup(
            package_dir=FOLDERS,
            packages=[
                ".".join(filter(None, (package, part)))
                for package, folder in FOLDERS.items()
                for part in ("", *find_namespace_packages(folder, exclude=["*__pycache__*"]))
            ],
            install_requires=LIBRARY if lean else LIBRARY + REST,
            long_description=for_index(readme, project["urls"].get("Source")),
            long_description_content_type="text/markdown",
            options={"build": {"build_base": build}},
        )


if __name__ == "__main__":
    main()
