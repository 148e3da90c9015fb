"""Archives of tensors: what they name, and what they would allocate."""

from __future__ import annotations

import collections
import zipfile

import pytest
import torch

from core.safe_files import FileError
from trainers.utils.tensor_archive import check_tensors, read_tensors


def saved(path, value):
    torch.save(value, path)
    return path


def test_plain_values_and_tensors_of_every_dtype_are_read(tmp_path):
    dtypes = (torch.float32, torch.float64, torch.float16, torch.bfloat16, torch.int64, torch.uint8, torch.bool)
    value = {"a": [1, 2.5, "x", None, True], "b": collections.OrderedDict(w=torch.nn.Parameter(torch.ones(3)))}
    value["c"] = {str(dtype): torch.ones(2, dtype=dtype) for dtype in dtypes}
    read = read_tensors(saved(tmp_path / "x.pt", value))
    assert read["a"] == value["a"]
    assert torch.equal(read["b"]["w"], torch.ones(3))
    assert all(torch.equal(read["c"][name], tensor) for name, tensor in value["c"].items())


@pytest.mark.parametrize(
    "value",
    [bytearray(10), {1, 2}, torch.device("cpu"), b"bytes", torch.ones(2).to_sparse(), collections.Counter("a")],
    ids=lambda value: type(value).__name__,
)
def test_an_archive_that_names_anything_else_is_refused(tmp_path, value):
    with pytest.raises(FileError, match="only tensors and plain values"):
        read_tensors(saved(tmp_path / "x.pt", {"x": value}))


def test_a_compressed_archive_is_refused(tmp_path):
    saved(tmp_path / "x.pt", torch.zeros(10**5))
    with (
        zipfile.ZipFile(tmp_path / "x.pt") as old,
        zipfile.ZipFile(tmp_path / "y.pt", "w", zipfile.ZIP_DEFLATED) as new,
    ):
        for name in old.namelist():
            new.writestr(name, old.read(name))
    with pytest.raises(FileError, match="is compressed"):
        read_tensors(tmp_path / "y.pt")


def test_a_tensor_larger_than_its_file_is_refused(tmp_path):
    with pytest.raises(FileError, match="larger than the file"):
        read_tensors(saved(tmp_path / "x.pt", torch.zeros(1).expand(10**9)))
    nested = [torch.zeros(1)]
    for _ in range(8):
        nested = [nested] * 10  # 80 references describe 10^8 tensors
    with pytest.raises(FileError, match="describes more than it holds"):
        check_tensors(nested, 10**12)
