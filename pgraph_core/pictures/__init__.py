"""Pictures and films of mechanisms, drawn without a screen or a graphics card.

* `files`: PNG and SVG of the view, the digraph and plots; MP4 and GIF of a run
* `drawing`: the camera, light and ground; `raster`: triangles as pixels; `vector`: SVG
"""
