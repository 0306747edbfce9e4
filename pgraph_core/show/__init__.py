"""Pictures and tables of models and runs for notebooks, files and web pages.

This package does not depend on models and runs, and draws any object with the same fields. trimesh,
matplotlib and the kernels of pictures are imported when first needed. `MissingPackage` gives the
name of a package that is not installed.

* `model_html(model)`, `mechanism_html(mech)`, `run_html(run)`: `_repr_html_` in a notebook
* `figure(t, columns, title)`: matplotlib
* `opened(page)` shows an HTML page in a notebook or browser
* `digraph_svg(names, parent, loops)`; `shapes`: bodies as simple pieces and meshes
* `pictures`: PNG, SVG, MP4, GIF without a screen, with camera, light and ground; `raster`:
  triangles as pixels
"""

from ..errors import MissingPackage as MissingPackage
from .digraph import digraph_svg as digraph_svg
from .notebook import Embedded as Embedded
from .notebook import figure as figure
from .notebook import mechanism_html as mechanism_html
from .notebook import model_html as model_html
from .notebook import opened as opened
from .notebook import run_html as run_html
