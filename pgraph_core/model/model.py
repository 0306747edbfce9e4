"""A model: the complete description of a multibody system, with its files and pictures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np

from ..errors import FileError, InputError, ModelError, Problem, explained, is_deep, shown
from ..fields import GROUND, fields_of, whole
from ..portable import array_of
from . import files
from .body import Body
from .editable import Editable
from .files import gathered, located
from .poses import home_poses


@explained
class Model(Editable):
    """A multibody system, consisting of the table rows in order and the parts that act on them.

    The order of the bodies in the table is also the order of children in the digraph, from left to
    right. Models are immutable, so every change returns a new, validated model.
    """

    @classmethod
    def serial(cls, n: int) -> Self:
        """Return n rods in series, named "1" to "n", as in the first table of section 4.1.

        The rods are slender, 0.2 m long, stretched along x at first and connected by hinges about
        y. Under gravity along -z they fall from there.

        Parameters
        ----------
        n : int
            Number of bodies.

        Examples
        --------
        >>> [body.parent for body in pg.Model.serial(3).bodies]
        ['ground', '1', '2']
        """
        count = whole(n)
        if count is None or count < 1:
            raise ModelError(Problem("model", "n", f"must be a whole number >= 1, got {n!r}"))
        inertia = ((2e-4, 0.0, 0.0), (0.0, 3.4e-3, 0.0), (0.0, 0.0, 3.4e-3))
        rod = Body(name="1", axes=((0, 1, 0),), com=(0.1, 0, 0), inertia=inertia, tip=(0.2, 0, 0))
        rows = [rod.unchecked_copy({"name": "1"})]
        linked = Body(**{**fields_of(rod), "link": rod.tip})
        for i in range(2, count + 1):
            rows.append(linked.unchecked_copy({"name": str(i), "parent": str(i - 1)}))
        return cls(name=f"serial {count}", bodies=tuple(rows))

    @classmethod
    def from_columns(
        cls,
        parent: Any,
        /,
        *,
        names: Iterable[str] | None = None,
        gravity: Any = None,
        **columns: Any,
    ) -> Self:
        """Return a model from a table of nb bodies given as NumPy columns.

        Parameters
        ----------
        parent : (nb,) array of int
            Row of each body's parent, from 1, with 0 for the ground.
        names : sequence of str, optional
            Names of the bodies, by default "1", "2", ...
        gravity : (3,) array, optional
            Gravity [m/s^2].
        **columns
            Fields of `Body`, such as `joint`, `link`, `mass` and `inertia`. Each has nb entries, or
            a single value for all bodies.

        Raises
        ------
        ModelError
            If an entry does not fit. The message names the body and the column.
        """
        given = {} if gravity is None else {"gravity": gravity}
        return cls(name="columns", bodies=bodies_of(parent, names, columns), **given)

    # -- files ---------------------------------------------------------------------------------

    @classmethod
    def from_json(
        cls,
        text: str,
        /,
        *,
        source: str = "text",
        folder: str | Path | None = None,
        roots: Iterable[str | Path] = (),
    ) -> Self:
        """Create a model from JSON text.

        Parameters
        ----------
        text : str
            Content of a Pgraph file.
        source : str, optional
            Name of the text in messages.
        folder : path, optional
            Folder from which relative paths of meshes start. The default is the current folder.
        roots : iterable of paths, optional
            Further folders in which meshes are permitted.

        Raises
        ------
        FileError
            If the text is not JSON, or was written by a later version.
        ModelError
            If the model is not valid.
        """
        return cls(**located(files.parse(text, source), folder, roots))

    @classmethod
    def load(cls, path: str | Path, /, *, roots: Iterable[str | Path] = ()) -> Self:
        """Load a built-in model, or a model from a Pgraph JSON file.

        `pg.load` also reads files of other formats.

        Parameters
        ----------
        path : path
            The file, or the name of a built-in model. Paths of meshes are relative to the folder of
            the file.
        roots : iterable of paths, optional
            Further folders in which meshes are permitted.

        Raises
        ------
        FileError
            If the file cannot be read.
        ModelError
            If the model is not valid.
        """
        path = files.found(path)
        folder = Path(path).parent
        return cls.from_json(files.read(path), source=str(path), folder=folder, roots=roots)

    def save(self, path: str | Path, /) -> None:
        """Save the model as a JSON file.

        Existing files are replaced atomically. Meshes from other folders are written to `meshes`
        next to the file, so that the folder can be moved to another machine.

        Parameters
        ----------
        path : path
            The file, with the suffix .json. Functions such as `pg.write_urdf` write other formats.

        Raises
        ------
        FileError
            If the file cannot be written or has the suffix of another format.
        """
        suffix = Path(path).suffix.lower()
        if suffix in files.FOREIGN:
            kind = files.FOREIGN[suffix]
            text = f"is not a Pgraph file; use pg.write_{kind}"
            if kind not in files.WRITTEN:
                text = f"is not written as {suffix}; use a name that ends in .json"
            raise FileError(Problem(str(path), "", text))
        if files.kind_of(path, b""):
            text = f"is JSON, not {suffix}; use a name that ends in .json"
            raise FileError(Problem(str(path), "", text))
        folder, model = Path(path).parent, self
        if folder.is_dir():
            model = self.unchecked_copy({"bodies": gathered(self.bodies, folder)})
        files.write_atomic(path, model.to_json())

    # -- pictures ------------------------------------------------------------------------------

    def _repr_html_(self) -> str:
        """Return the digraph and the table of bodies as HTML, for notebooks."""
        from ..show import model_html

        return model_html(self)

    def to_image(
        self, path: str | Path, /, *, what: Literal["view", "digraph"] = "view",
        size: tuple[int, int] | None = None, view: str = "start", dark: bool = False,
    ) -> None:  # fmt: skip
        """Draw the mechanism in its initial state, or its digraph, without a display.

        Parameters
        ----------
        path : str or path
            The file to write: .png, or .svg of the digraph.
        what : {"view", "digraph"}
            What to draw.
        size : (int, int), optional
            Width and height in pixels.
        view : {"start", "front", "side", "top", "isometric"}
            Direction of the view.
        dark : bool
            Whether to draw on a dark background.

        Raises
        ------
        InputError, FileError
            If arguments are invalid or the file cannot be written.
        """
        from ..show import pictures  # with its kernels, which a description has no need of
        from ..show.notebook import numbered

        if what not in ("view", "digraph"):
            text = f"must be 'view' or 'digraph', got {what!r}"
            raise InputError(Problem("to_image", "what", text))
        if what == "digraph":
            drawn = pictures.digraph(self, path, size=size)
        else:
            whole, size = self.expanded, (1280, 720) if size is None else size
            pose = home_poses(numbered(whole)[0])
            drawn = pictures.view(whole, pose, path, size=size, view=view, dark=dark)
        files.write_atomic(path, drawn)


# -- bodies from NumPy columns, with one entry per row or one for all rows -------------------------


LEVELS = {
    "link": 1,
    "axes": 1,
    "com": 1,
    "tip": 1,
    "rotation": 1,
    "inertia": 2,
}  # depth of lists, from one


def bodies_of(
    parent: Any, names: Iterable[str] | None, columns: Mapping[str, Any]
) -> tuple[Body, ...]:
    """Return a body for each entry in `parent` (nb,), with rows numbered from 1 and 0 for the
    ground.

    `columns` contains fields of `Body`: nb entries, or one for all. Raises ModelError.
    """
    above = _array("parent", parent)
    if above.ndim != 1 or (above.size and above.dtype.kind not in "iu"):
        raise _refused("parent", f"must be a list of whole numbers, got {shown(parent)}")
    n = len(above)
    given = [str(i) for i in range(1, n + 1)] if names is None else list(names)
    if len(given) != n:
        raise _refused("names", f"must have length {n}, one entry per body, got {len(given)}")
    wrong = np.flatnonzero((above < 0) | (above > n))
    if wrong.size:
        row = int(wrong[0])
        text = f"must be a row from 1 to {n}, or 0 for the ground, got {above[row]}"
        raise ModelError(Problem(f"body '{given[row]}'", "parent", text))
    label = [GROUND, *given]
    rows = [_rows(name, value, n) for name, value in columns.items() if value is not None]
    fields = [name for name, value in columns.items() if value is not None]
    return tuple(
        Body(**{"name": name, "parent": label[p], **dict(zip(fields, values))})
        for name, p, *values in zip(given, above.tolist(), *rows)
    )


def _rows(name: str, value: Any, n: int) -> list[Any]:
    """Return the entries of a column for all rows."""
    array = _array(name, value)
    entries = array.tolist()
    if array.ndim == LEVELS.get(name, 0):
        return [entries] * n
    if len(entries) != n:
        text = f"must have {n} entries, one per body, or one for all, got {len(entries)}"
        raise _refused(name, text)
    return entries


def _array(name: str, value: Any) -> Any:
    """Return a column as an array, with dtype object if its entries differ in length."""
    try:
        return array_of(value)
    except ValueError:
        if not isinstance(value, (list, tuple)) or is_deep(value):
            raise _refused(name, f"must be a column, got {shown(value)}") from None
    array = np.empty(len(value), object)
    array[:] = value
    return array


def _refused(column: str, text: str) -> ModelError:
    return ModelError(Problem("columns", column, text))
