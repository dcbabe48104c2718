"""Files that are read and written whole."""

from __future__ import annotations

import pytest

from overtaking.core.files import read_toml, write_atomically


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
