"""What is written can be read again, and strange files are told as such."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tests.perception import synthetic

from setae.errors import InputError
from setae.heightmap import HeightMap
from setae.objects import ScanObject
from setae.perception import cloud, maps


@pytest.fixture(scope="module")
def coil() -> HeightMap:
    return synthetic.felt(ScanObject(shape="coil"))


@pytest.mark.parametrize("suffix", cloud.SUFFIXES)
def test_a_cloud_survives_its_file(suffix: str, coil: HeightMap, tmp_path: Path) -> None:
    points = cloud.of_map(coil)
    again = cloud.read(cloud.write(tmp_path / f"coil{suffix}", points))
    assert (again.points_mm == points.points_mm).all()
    if suffix != ".npy":
        assert (again.mark == points.mark).all()


def test_a_cloud_holds_what_was_touched_and_not_what_was_inferred() -> None:
    heights = HeightMap(
        x_mm=np.array([0.0, 10.0, 20.0]),
        y_mm=np.array([0.0]),
        height_mm=np.array([[-90.0, -91.0, np.nan]]),
        mark=np.array([["felt", "inferred", "lost"]]),
    )
    assert cloud.of_map(heights).points_mm.tolist() == [[0.0, 0.0, -90.0]]
    assert len(maps.known(heights)) == 2


def test_a_ply_of_another_program_is_read(tmp_path: Path) -> None:
    path = tmp_path / "other.ply"
    path.write_text(
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float nx\nproperty float x\n"
        "property float y\nproperty float z\nelement face 0\nproperty list uchar int i\n"
        "end_header\n1 2 3 4\n0 5 6 7\n"
    )
    assert cloud.read(path).points_mm.tolist() == [[2.0, 3.0, 4.0], [5.0, 6.0, 7.0]]


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("a.ply", b"ply\nformat binary_little_endian 1.0\nend_header\n"),
        ("a.ply", (b"ply\nformat ascii 1.0\nelement vertex 9\nproperty float x\n"
                  b"property float y\nproperty float z\nend_header\n1 2 3\n")),
        ("a.csv", b"a,b\n1,2\n"),
        ("a.npy", b"not numpy"),
        ("a.npz", b""),
        ("a.xyz", b"1 2 3\n"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_cloud_is_told(name: str, data: bytes, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match="a\\."):
        cloud.read(tmp_path / name)


@pytest.mark.parametrize("name", ["a.npz", "a.npy", "a.csv", "a.ply"])
def test_a_damaged_file_is_told(name: str, coil: HeightMap, tmp_path: Path) -> None:
    # A half-copied map ended `setae cluster` in a traceback of zipfile, and one with a wrong byte
    # in zlib's; so did a cut row of a table. And one such map took a study's whole report along.
    path = tmp_path / name
    cloud.write(path, cloud.of_map(coil))
    read: list[tuple[Callable[[Path], object], bytes]] = [(cloud.read, path.read_bytes())]
    if path.suffix == ".npz":
        maps.write(path, coil)
        read.append((maps.read, path.read_bytes()))
    rng = np.random.default_rng(1)
    for reader, whole in read:
        for at in rng.integers(len(whole), size=60):
            wrong = bytearray(whole)
            wrong[at] ^= 0x55
            for data in (whole[:at], bytes(wrong)):
                path.write_bytes(data)
                with contextlib.suppress(InputError):
                    reader(path)
                path.unlink()  # closed, whatever was in it


def test_a_file_with_a_pickle_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "evil.npz"
    np.savez(path, points_mm=np.array([{}], dtype=object), mark=np.array(["felt"]))
    with pytest.raises(InputError, match="evil"):
        cloud.read(path)


def test_a_map_survives_its_file(coil: HeightMap, tmp_path: Path) -> None:
    again = maps.read(maps.write(tmp_path / "coil.npz", coil))
    assert (again.mark == coil.mark).all()
    assert np.array_equal(again.height_mm, coil.height_mm, equal_nan=True)
    (tmp_path / "other.npz").write_bytes(b"PK")
    with pytest.raises(InputError, match="other"):
        maps.read(tmp_path / "other.npz")
