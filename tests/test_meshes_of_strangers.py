"""Meshes and models that a file names: missing, cut off, in Git LFS, with buffers."""

import base64
import itertools
import json

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.formats import read_model
from pgraph_core.mesh_files import load_mesh
from tests.refusals import assert_names

from .test_files_of_strangers import with_mesh, written

POINTER = b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n"


STL = bytes(80) + (7).to_bytes(4, "little") + bytes(50 * 7)


@pytest.mark.parametrize("name", ["part.stl", "part.obj", "part.dae", "part.glb", "part.gltf"])
@pytest.mark.parametrize("role", ["visual", "collision"])
def test_a_mesh_that_stands_for_one_in_git_lfs_is_said_to_be_that(tmp_path, name, role):
    written(tmp_path, POINTER, name)
    _, report = read_model(written(tmp_path, with_mesh(name, role)))
    assert report.loaded == (role == "visual")
    assert_names(str(report), "Git LFS", "git lfs pull", name)


@pytest.mark.parametrize("name", ["robot.urdf", "robot.xml", "robot.json"])
def test_a_model_in_git_lfs_is_said_to_be_that(tmp_path, name):
    with pytest.raises(pg.FileError) as refused:
        pg.load(written(tmp_path, POINTER, name))
    assert_names(str(refused.value), "git lfs pull", name)


@pytest.mark.parametrize("kept", [0, 1, 6])
def test_an_stl_file_that_is_cut_off_says_how_much_there_is(tmp_path, kept):
    written(tmp_path, STL[: 84 + 50 * kept + 3], "part.stl")
    _, report = read_model(written(tmp_path, with_mesh("part.stl")))
    assert_names(str(report), "7 triangles", f"holds {kept}")


CORNERS = np.array([0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3], "<f4").tobytes()


FACES = np.array([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3], "<u2").tobytes()


def gltf(folder, buffers):
    """Write a tetrahedron with its corners in one buffer and its faces in another one."""
    blobs, uris = (CORNERS, FACES), []
    for k, place in enumerate(buffers):
        if place == "inside":
            uris.append(
                "data:application/octet-stream;base64," + base64.b64encode(blobs[k]).decode()
            )
        else:
            uris.append(place.replace(" ", "%20"))
            written(folder, blobs[k], place)
    sizes = [len(blob) for blob in blobs]
    views = [{"buffer": k, "byteLength": n} for k, n in enumerate(sizes)]
    number = {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"}
    place = {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
             "min": [0, 0, 0], "max": [1, 2, 3]}  # fmt: skip
    part = {"attributes": {"POSITION": 0}, "indices": 1, "material": 0}
    data = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": [5, 0, 0]}], "meshes": [{"primitives": [part]}],
        "accessors": [place, number], "bufferViews": views, "images": [{"uri": "not-there.png"}],
        "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}}],
        "buffers": [{"byteLength": n, "uri": uri} for n, uri in zip(sizes, uris)],
    }  # fmt: skip
    return written(folder, json.dumps(data), "part.gltf")


@pytest.mark.parametrize(
    "buffers", [*itertools.product(("inside", "a.bin", "bins/b c.bin"), ("inside", "d.bin"))]
)
def test_a_gltf_mesh_is_read_with_its_buffers(tmp_path, buffers):
    path = gltf(tmp_path, buffers)
    mesh = load_mesh(path)
    assert mesh.volume == pytest.approx(1.0)
    np.testing.assert_allclose(mesh.bounds, [[5, 0, 0], [6, 2, 3]])
    model, report = read_model(written(tmp_path, with_mesh("part.gltf", "visual")))
    assert report.loaded
    assert model.body("b").shapes[0].colour == pytest.approx((1.0, 0.0, 0.0))
    (tmp_path / "saved").mkdir()
    model.save(tmp_path / "saved" / "m.json")
    again = pg.load(tmp_path / "saved" / "m.json").body("b").shapes[0]
    assert load_mesh(again.file).volume == pytest.approx(1.0)


@pytest.mark.parametrize("uri", ["../secret.bin", "/etc/hostname", "gone.bin", ""])
def test_a_gltf_mesh_opens_buffers_of_its_folder_only(tmp_path, uri):
    written(tmp_path, CORNERS + FACES, "secret.bin")
    path = gltf(tmp_path / "robot", ("inside", "inside"))
    data = json.loads(path.read_text())
    data["buffers"][0]["uri"] = uri
    path.write_text(json.dumps(data))
    with pytest.raises(pg.FileError) as refused:
        load_mesh(path)
    assert_names(str(refused.value), "buffer", repr(uri))
