"""Reading XML of strangers: what is understood, and what is refused before it costs anything."""

import os
import subprocess
import sys
import textwrap
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from overtaking.core.errors import ImportFormatError
from overtaking.recordings.messages import shown
from overtaking.recordings.xml import Element, Limits, elements

DOCUMENT = """<?xml version="1.0" encoding="UTF-8"?>
<zoo city="Évora">
  <!-- a comment -->
  <keeper name="Ana"/>
  <cage id="1"><lion age="3.5">roars &amp; <b>sleeps</b></lion><straw><bale/></straw></cage>
  <cage id="2"/>
</zoo>
"""


def read(path: Path, **options) -> list[Element]:
    return list(elements(path, root="zoo", keep=lambda name, _: name == "cage", **options))


def write(folder: Path, content: str | bytes) -> Path:
    path = folder / "zoo.xml"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def refusal(path: Path, **options) -> str:
    with pytest.raises(ImportFormatError) as caught:
        read(path, **options)
    message = str(caught.value)
    assert "\n" not in message
    assert len(message) < 600
    return message


def test_root_comes_first_then_the_wanted_children(tmp_path: Path):
    root, first, second = read(write(tmp_path, DOCUMENT))
    assert (root.name, root.attributes, root.children) == ("zoo", {"city": "Évora"}, [])
    assert (first.line, second.line) == (5, 6)
    lion = first.required("lion")
    assert lion.number("age") == 3.5
    assert lion.text == "roars &"
    assert lion.required("b").text == "sleeps"
    assert second.children == []


def test_skipped_elements_are_left_out_with_all_inside_them(tmp_path: Path):
    _, cage, _ = read(write(tmp_path, DOCUMENT), skip=frozenset(["straw"]))
    assert [child.name for child in cage.children] == ["lion"]
    assert "straw" not in [child.name for child in cage.children]


def test_white_space_between_elements_is_no_text(tmp_path: Path):
    """A border of 658 points, each on a line of its own behind seven blanks, was refused."""
    points = "\n       <p>1</p>" * 658
    _, cage = read(write(tmp_path, f"<zoo>\n <cage>\n{points}\n </cage>\n</zoo>"))
    assert len(cage.children) == 658
    assert cage.text == ""
    padded = f"<zoo><cage>{' ' * 50_000}12{chr(10) * 50_000}</cage></zoo>"
    assert read(write(tmp_path, padded))[1].text == "12"


@pytest.mark.parametrize(
    "encoding", ["utf-8", "utf-8-sig", "utf-16", "iso-8859-1", "us-ascii", "cp1252"]
)
def test_common_encodings_are_read(tmp_path: Path, encoding: str):
    name = encoding.removesuffix("-sig")
    document = DOCUMENT.replace("UTF-8", name)
    content = document.encode(encoding, "xmlcharrefreplace")
    assert read(write(tmp_path, content))[0].attributes["city"] == "Évora"


trees = st.recursive(
    st.builds(
        ET.Element,
        st.sampled_from("abc"),
        st.dictionaries(st.sampled_from("xy"), st.text("<&\"' é", max_size=3)),
    ),
    lambda children: st.builds(
        lambda parent, inside: (parent.extend(inside), parent)[1],
        st.builds(ET.Element, st.sampled_from("abc")),
        st.lists(children, max_size=3),
    ),
    max_leaves=12,
)


@pytest.mark.ci
@given(st.lists(trees, max_size=4))
def test_elements_are_those_of_the_standard_library(tmp_path_factory, cages: list[ET.Element]):
    """What we build equals what `xml.etree` builds from the same text."""
    root = ET.Element("zoo")
    for tree in cages:
        cage = ET.SubElement(root, "cage")
        cage.append(tree)
    path = tmp_path_factory.getbasetemp() / "round.xml"
    path.write_bytes(ET.tostring(root))

    def shape(element) -> tuple:
        if isinstance(element, Element):
            name, inside = element.name, element.children
            attributes = element.attributes
        else:
            name, inside, attributes = element.tag, list(element), element.attrib
        return name, dict(attributes), [shape(child) for child in inside]

    expected = [shape(child) for child in ET.parse(path).getroot()]
    assert [shape(element) for element in read(path)[1:]] == expected


LAUGHS = "".join(
    f'<!ENTITY l{level} "{f"&l{level - 1};" * 10 if level else "lol"}">' for level in range(10)
)
HOSTILE = {
    "billion laughs": f"<!DOCTYPE zoo [{LAUGHS}]><zoo><cage id='&l9;'/></zoo>",
    "external entity": '<!DOCTYPE zoo [<!ENTITY x SYSTEM "file:///etc/passwd">]><zoo>&x;</zoo>',
    "parameter entity": '<!DOCTYPE zoo [<!ENTITY % x SYSTEM "http://127.0.0.1/x"> %x;]><zoo/>',
    "external subset": '<!DOCTYPE zoo SYSTEM "http://127.0.0.1/zoo.dtd"><zoo/>',
    "plain document type": "<!DOCTYPE zoo><zoo/>",
}


@pytest.mark.parametrize("content", HOSTILE.values(), ids=HOSTILE.keys())
def test_document_types_are_refused_whatever_is_in_them(tmp_path: Path, content: str):
    message = refusal(write(tmp_path, content))
    assert message.startswith("zoo.xml: line 1: document type: expected none: entities are refused")


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "no element found"),
        (b"   \n", "no element found"),
        (b"not XML at all", "syntax error"),
        (b"\x00\x01\x02\xff\xfe" * 100, "not well-formed"),
        (b"<zoo>", "no element found"),
        (b"<zoo><cage></zoo>", "mismatched tag"),
        (b"<zoo/><zoo/>", "junk after document element"),
        (b"<zoo><cage id='1' id='2'/></zoo>", "duplicate attribute"),
        (b"<zoo>&lion;</zoo>", "undefined entity"),
        (b"<zoo>\xff</zoo>", "not well-formed"),
        (b"<park/>", "root element: expected <zoo>, got <park>"),
        (b"\x1f\x8b\x08rest", "complete, not compressed, and UTF-8"),
        (b"PK\x03\x04rest", "complete, not compressed, and UTF-8"),
        (b'<?xml version="1.0" encoding="utf-7"?><zoo/>', "multi-byte encodings are not supported"),
        (b'<?xml version="1.0" encoding="no-such"?><zoo/>', "unknown encoding: no-such"),
        (b'<?xml version="1.0" encoding="undefined"?><zoo/>', "expected well-formed XML"),
        (b'<?xml version="1.0" encoding="base64"?><zoo/>', "expected well-formed XML"),
    ],
)
def test_what_is_no_such_document_is_refused(tmp_path: Path, content: bytes, reason: str):
    message = refusal(write(tmp_path, content))
    assert message.startswith("zoo.xml: line ")
    assert reason in message


def test_a_document_cut_anywhere_is_refused(tmp_path: Path):
    whole = DOCUMENT.rstrip().encode()
    assert len(read(write(tmp_path, whole))) == 3
    for size in range(len(whole)):
        refusal(write(tmp_path, whole[:size]))


@pytest.mark.parametrize(
    ("content", "limits", "reason"),
    [
        ("<zoo>" + "<a/>" * 9 + "</zoo>", Limits(elements=9), "at most 9 elements"),
        ("<zoo><cage>" + "<a/>" * 9 + "</cage></zoo>", Limits(kept=9), "child of <zoo> is too"),
        (
            '<zoo><cage a="1" b="2" c="3"/></zoo>',
            Limits(kept=3),
            "at most 3 elements and attributes",
        ),
        ('<zoo a="1" b="2" c="3"/>', Limits(names=3), "at most 3 names"),
        ('<zoo a="12345"/>', Limits(characters=4), "at most 4 characters"),
        ("<zoo><cage>12345</cage></zoo>", Limits(characters=4), "text of <cage> is too large"),
        ("<zoo>" + " " * 99 + "</zoo>", Limits(file_bytes=99), "zoo.xml: is too large: expected"),
        (f"<zoo><!--{'x' * 300_000}--></zoo>", Limits(token_bytes=100_000), "tag or comment"),
        (f'<zoo a="{"x" * 300_000}"/>', Limits(token_bytes=100_000), "tag or comment"),
    ],
)
def test_what_exceeds_a_limit_is_refused(tmp_path: Path, content: str, limits: Limits, reason: str):
    assert reason in refusal(write(tmp_path, content), limits=limits)


def test_exactly_the_limits_are_accepted(tmp_path: Path):
    content = '<zoo a="1234"><cage>1234<a/></cage></zoo>'
    limits = Limits(file_bytes=len(content), names=3, elements=3, kept=2, characters=4)
    assert len(read(write(tmp_path, content), limits=limits)) == 2


def test_a_file_that_grows_while_it_is_read_is_refused(tmp_path: Path):
    path = write(tmp_path, "<zoo><cage/>" + " " * 200_000)
    document = elements(
        path, root="zoo", keep=lambda *_: True, limits=Limits(file_bytes=path.stat().st_size)
    )
    next(document)
    with path.open("a") as stream:
        stream.write(" " * 200_000 + "</zoo>")
    with pytest.raises(ImportFormatError, match="file is too large"):
        list(document)


def test_only_plain_files_are_opened(tmp_path: Path):
    assert "No such file" in refusal(tmp_path / "missing.xml")
    assert "a folder, pipe or device" in refusal(tmp_path)
    assert "null character" in refusal(Path("a\0b"))
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    assert "a folder, pipe or device" in refusal(pipe)  # Opening it would wait for ever.


def test_messages_show_names_of_strangers_on_one_short_line():
    assert shown("a\nb\x1b[31m\u2028c") == "a?b?[31m?c"
    assert shown("x" * 1000) == "x" * 37 + "..."


CONFINED = """
import resource, sys
from pathlib import Path
from overtaking.core.errors import ImportFormatError
from overtaking.recordings.xml import elements
resource.setrlimit(resource.RLIMIT_CPU, (20, 20))
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
for path in sys.argv[1:]:
    try:
        list(elements(Path(path), root="zoo", keep=lambda *_: True))
    except ImportFormatError as error:
        print(str(error).split(": ", 1)[1])
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


@pytest.mark.ci
def test_large_hostile_files_cost_little_time_and_memory(tmp_path: Path):
    """A million open elements, 40 MB in one comment, tag or text, or in attributes or names."""
    million, size = 1_000_000, 40_000_000
    crowd = b"".join(b" a%d=''" % n for n in range(9_000))
    contents = {
        "nested": b"<zoo>" + b"<a>" * million,
        "comment": b"<zoo><!--" + b"x" * size,
        "tag": b'<zoo a="' + b"x" * size,
        "text": b"<zoo><a>" + b"x" * size,
        "wide": b"<zoo><cage>" + b"<a/>" * million,
        "attributes": b"<zoo><cage>" + (b"<b" + crowd + b"/>") * 60,
        "names": b"<zoo>" + b"".join(b"<a%d/>" % n for n in range(million)),
    }
    paths = [tmp_path / name for name in contents]
    for path, content in zip(paths, contents.values(), strict=True):
        path.write_bytes(content)
    result = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(CONFINED), *map(str, paths)],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    *refusals, growth_kib = result.stdout.splitlines()
    assert [line.split(": ")[1].split(" is too large")[0] for line in refusals] == [
        "child of <zoo>",
        "tag or comment",
        "tag or comment",
        "text of <a>",
        "child of <zoo>",
        "child of <zoo>",
        "file",
    ]
    assert int(growth_kib) < 256 * 1024


@pytest.mark.parametrize(
    ("text", "value"),
    [("1", 1.0), ("-1.5e-3", -1.5e-3), (" +.5 ", 0.5), ("7.", 7.0), ("1E8", 1e8), ("-0", 0.0)],
)
def test_numbers_of_xml_schema_are_read(text: str, value: float):
    element = Element(file="f", line=1, name="e", attributes={"x": text})
    assert element.number("x") == value
    assert element.number("y", default=2.0) == 2.0


@pytest.mark.parametrize(
    "text",
    [
        *("", " ", "nan", "NaN", "INF", "-INF", "inf", "infinity", "1e999", "1e9", "-2e8", "1_0"),
        *("0x10", "1,5", "1 2", "١", "one", "1" * 65, "--1", "1e", ".", "1\n\n2", "1\x00"),
    ],
)
def test_what_is_no_finite_number_is_refused_with_file_line_and_attribute(text: str):
    element = Element(file="f", line=7, name="e", attributes={"x": text})
    with pytest.raises(ImportFormatError) as caught:
        element.number("x")
    assert str(caught.value).startswith("f: line 7: <e> attribute x: expected a ")


@pytest.mark.parametrize("text", ["", "1.0", "1e3", "12345678901", "x", "1_0", "²"])
def test_what_is_no_integer_is_refused(text: str):
    element = Element(file="f", line=7, name="e", attributes={"x": text})
    with pytest.raises(ImportFormatError, match="expected an integer"):
        element.integer("x")


def test_missing_and_repeated_parts_are_refused(tmp_path: Path):
    document = "<zoo><cage><lion/><lion/></cage></zoo>"
    cage = read(write(tmp_path, document))[1]
    with pytest.raises(ImportFormatError, match="<lion> is there twice"):
        cage.optional("lion")
    with pytest.raises(ImportFormatError, match="expected a <tiger> in it, got none"):
        cage.required("tiger")
    with pytest.raises(ImportFormatError, match="expected an attribute id, got none"):
        cage.attribute("id")
    assert cage.optional("tiger") is None
    assert cage.attribute("id", default="-1") == "-1"
