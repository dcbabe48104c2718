"""Files that decode to what was drawn, or no files at all."""

from __future__ import annotations

import builtins
import struct

import av
import numpy as np
import pytest

from overtaking.core.errors import DatasetError, MissingExtraError
from overtaking.show.video import encode
from overtaking.show.video.canvas import HEIGHT, WIDTH
from overtaking.show.video.encode import Interrupted, write_film


@pytest.fixture(scope="module")
def file(film, tmp_path_factory):
    path = tmp_path_factory.mktemp("films") / "000000.mp4"
    write_film(film, path, title="Simulation 0")
    return path


def test_the_file_is_what_every_player_opens(film, file):
    with av.open(str(file)) as container:
        stream = container.streams.video[0]
        assert stream.codec_context.name == "h264"
        assert stream.pix_fmt == "yuv420p"
        assert (stream.width, stream.height) == (WIDTH, HEIGHT) == (1280, 400)
        assert stream.average_rate == 20
        assert stream.frames == film.num_frames
        seconds = (container.duration or 0) / av.time_base
        assert seconds == pytest.approx(film.num_frames / 20.0, abs=0.01)
        assert stream.codec_context.colorspace == 6  # BT.601, as the colours are made.
        assert sum(1 for _ in container.decode(stream)) == film.num_frames


def boxes(data: bytes) -> list[str]:
    """Names of the outermost boxes of an mp4 file (ISO/IEC 14496-12)."""
    names, at = [], 0
    while at < len(data):
        size, name = struct.unpack_from(">I4s", data, at)
        names.append(name.decode())
        at += size
    return names


def test_the_index_stands_before_the_pictures_so_that_browsers_can_begin(file):
    names = boxes(file.read_bytes())
    assert names.index("moov") < names.index("mdat")


def test_the_decoded_pictures_are_those_that_were_drawn(film, file):
    with av.open(str(file)) as container:
        decoded = [frame.to_ndarray(format="yuv420p") for frame in container.decode(video=0)]
    drawn = np.empty_like(decoded[0])
    for number in (0, 13, film.num_frames - 1):
        film.draw(number).write_yuv(drawn)
        error = decoded[number][:HEIGHT].astype(float) - drawn[:HEIGHT]
        psnr = 10.0 * np.log10(255.0**2 / np.mean(error**2))
        assert psnr > 36.0  # Above this people see no difference.


def test_the_same_film_is_the_same_file(film, file, tmp_path):
    write_film(film, tmp_path / "again.mp4", title="Simulation 0")
    assert (tmp_path / "again.mp4").read_bytes() == file.read_bytes()


def test_the_film_is_the_same_whatever_the_processor_can_do(film, file, tmp_path, monkeypatch):
    monkeypatch.setattr(encode, "_options", lambda: dict(encode._OPTIONS))
    write_film(film, tmp_path / "plain.mp4", title="Simulation 0")
    with av.open(str(tmp_path / "plain.mp4")) as one, av.open(str(file)) as other:
        for plain, usual in zip(one.decode(video=0), other.decode(video=0), strict=True):
            assert np.array_equal(plain.to_ndarray(), usual.to_ndarray())


def test_nothing_is_left_of_a_film_that_was_interrupted(film, tmp_path):
    path = tmp_path / "film.mp4"
    path.write_bytes(b"as it was")
    answers = iter([True] * 5 + [False] * 5)
    with pytest.raises(Interrupted):
        write_film(film, path, is_wanted=lambda: next(answers))
    assert path.read_bytes() == b"as it was"
    assert list(tmp_path.iterdir()) == [path]


def test_a_failing_encoder_is_told_in_one_line(film, tmp_path, monkeypatch):
    monkeypatch.setitem(encode._OPTIONS, "x264-params", "keyint=1")
    monkeypatch.setitem(encode._OPTIONS, "preset", "no such preset")
    with pytest.raises(DatasetError, match="expected an encoder that writes it") as caught:
        write_film(film, tmp_path / "film.mp4")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "film.mp4").exists()


@pytest.mark.parametrize("missing", ["av", "PIL"])
def test_a_missing_extra_is_told_in_one_line(missing, monkeypatch):
    load = builtins.__import__

    def without(name, *rest):
        if name.split(".")[0] == missing:
            raise ImportError(name)
        return load(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(MissingExtraError, match=r"pip install 'av>=") as caught:
        encode.require()
    assert "\n" not in str(caught.value)
