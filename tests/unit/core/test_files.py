"""Files that are read and written whole."""

from __future__ import annotations

import errno
from contextlib import suppress

import pytest

from overtaking.core.files import atomic_file, atomic_folder, read_toml, write_atomically


@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
def test_toml_is_read_with_and_without_a_byte_order_mark(tmp_path, mark):
    path = tmp_path / "profile.toml"
    path.write_bytes(mark + 'name = "Évora"\n'.encode())
    assert read_toml(path, 100) == {"name": "Évora"}


def test_a_toml_file_that_is_too_large_is_refused(tmp_path):
    path = tmp_path / "profile.toml"
    path.write_bytes(b"#" * 101)
    with pytest.raises(OSError, match="more than 100 bytes"):
        read_toml(path, 100)


def test_a_folder_is_not_replaced_by_a_file(tmp_path):
    with pytest.raises(IsADirectoryError, match=str(tmp_path)):
        write_atomically(tmp_path, b"content")


def test_a_file_replaces_a_symbolic_link_to_nothing(tmp_path):
    path = tmp_path / "link"
    path.symlink_to(tmp_path / "nowhere")
    write_atomically(path, b"content")
    assert path.read_bytes() == b"content"
    assert not (tmp_path / "nowhere").exists()


def test_a_link_to_an_empty_folder_leads_to_the_new_folder(tmp_path):
    link, target = tmp_path / "link", tmp_path / "target"
    target.mkdir()
    link.symlink_to(target)
    with atomic_folder(link) as folder:
        (folder / "file").write_bytes(b"content")
    assert link.is_symlink()
    assert (target / "file").read_bytes() == b"content"
    assert sorted(tmp_path.iterdir()) == [link, target]


def test_a_file_is_replaced_when_the_block_has_succeeded(tmp_path):
    path = tmp_path / "film.mp4"
    path.write_bytes(b"old")
    with atomic_file(path) as partial:
        assert (partial.parent, partial.suffix) == (tmp_path, ".mp4")
        partial.write_bytes(b"new")
        assert path.read_bytes() == b"old"
    assert path.read_bytes() == b"new"
    assert list(tmp_path.iterdir()) == [path]


def test_a_block_that_fails_leaves_the_earlier_file_alone(tmp_path):
    path = tmp_path / "film.mp4"
    path.write_bytes(b"old")
    with suppress(KeyError), atomic_file(path) as partial:
        partial.write_bytes(b"new")
        raise KeyError
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_an_error_of_writing_names_the_file_and_not_the_partial_one(tmp_path):
    path = tmp_path / "missing" / "film.mp4"
    with pytest.raises(FileNotFoundError) as caught:
        write_atomically(path, b"content")
    assert caught.value.filename == str(path)
    path = tmp_path / "film.mp4"
    with pytest.raises(OSError, match="No space left") as caught, atomic_file(path):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert caught.value.filename == str(path)
    with pytest.raises(FileNotFoundError) as caught, atomic_file(path):
        (tmp_path / "input").read_bytes()
    assert caught.value.filename == str(tmp_path / "input")
