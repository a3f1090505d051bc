"""The strict mustache: its output, and every template and context that it rejects."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from pathlib import Path

import pytest

from fusesoc_firm.text.render import Rendering, TemplateError, render, traced_lines

Expand = Callable[..., str]


@pytest.fixture
def expand(tmp_path: Path) -> Expand:
    """Render a template given as text; partials are keyword arguments."""

    def render_text(template: str, context: dict[str, object], **partials: str) -> str:
        # Each call has a folder of its own, since parsed templates are cached by path.
        folder = tmp_path / str(len(list(tmp_path.iterdir())))
        (folder / "partials").mkdir(parents=True)
        (folder / "t.vhd.mustache").write_text(template)
        for name, text in partials.items():
            (folder / "partials" / f"{name}.mustache").write_text(text)
        return render("t.vhd", context, folder)

    return render_text


@pytest.mark.parametrize("tag", ["{{x}}", "{{{x}}}", "{{& x}}"])
def test_values_are_never_escaped(expand: Expand, tag: str) -> None:
    assert expand(f"a {tag} b", {"x": "a <= b & \"c\" > 'd'"}) == "a a <= b & \"c\" > 'd' b"


def test_zero_is_a_value(expand: Expand) -> None:
    assert expand("{{x}}{{#l}}[{{.}}]{{/l}}", {"x": 0, "l": [0, 1, ""]}) == "0[0][1][]"


def test_dotted_keys(expand: Expand) -> None:
    assert expand("{{a.b.c}}", {"a": {"b": {"c": 7}}}) == "7"


def test_section_of_a_bool_keeps_the_scope(expand: Expand) -> None:
    template = "{{#on}}yes {{x}}{{/on}}{{^on}}no {{x}}{{/on}}"
    assert expand(template, {"on": True, "x": 1}) == "yes 1"
    assert expand(template, {"on": False, "x": 1}) == "no 1"


def test_section_of_a_list_takes_each_item_as_its_scope(expand: Expand) -> None:
    ports = [{"name": "a", "last": False}, {"name": "b", "last": True}]
    template = "{{#ports}}\n  {{name}}{{^last}};{{/last}}\n{{/ports}}\n{{^ports}}\n  none\n{{/ports}}\n"
    assert expand(template, {"ports": ports}) == "  a;\n  b\n"
    assert expand(template, {"ports": []}) == "  none\n"


def test_section_of_an_optional_mapping(expand: Expand) -> None:
    template = "{{#m}}{{x}}{{/m}}{{^m}}-{{/m}}"
    assert expand(template, {"m": {"x": "in"}}) == "in"
    assert expand(template, {"m": None}) == "-"
    assert expand("{{#m}}there{{/m}}{{^m}}-{{/m}}", {"m": {}}) == "there"


def test_a_partial_is_indented_as_its_tag(expand: Expand) -> None:
    text = expand("begin\n  {{> ports}}\nend\n", {"l": ["a", "b"]}, ports="{{#l}}\n{{.}} :\n\n{{/l}}\n")
    assert text == "begin\n  a :\n\n  b :\n\nend\n"


def test_an_empty_partial_leaves_no_blanks(expand: Expand) -> None:
    assert expand("a\n  {{> p}}\nb\n", {"l": []}, p="{{#l}}{{.}}{{/l}}") == "a\nb\n"


def test_a_partial_within_a_line_is_not_indented(expand: Expand) -> None:
    assert expand("{{x}} {{> p}};\n", {"x": 1}, p="a\nb") == "1 a\nb;\n"


@pytest.mark.parametrize(
    ("template", "context", "message"),
    [
        ("{{widht}}", {"width": 8}, "no 'widht' in the context; it has width"),
        ("{{a.c}}", {"a": {"b": 1}}, "no 'a.c' in a; it has b"),
        ("{{a.b}}", {"a": 3}, "no 'a.b' in a; it is of type int"),
        # The outer `width` must not replace the one that the second port lacks.
        (
            "{{#ports}}{{width}}{{/ports}}",
            {"width": 8, "ports": [{"width": 1}, {"name": "b"}]},
            "no 'width' in ports[1]; it has name",
        ),
        ("{{#a}}{{#b}}{{x}}{{/b}}{{/a}}", {"x": 1, "a": {"b": [{"y": 1}]}}, "no 'x' in a.b[0]; it has y"),
        # An omitted section is checked, too: its fault would otherwise appear only with other data.
        ("{{#on}}{{x}}{{/on}}", {"on": False}, "no 'x' in the context; it has on"),
        ("{{^l}}{{x}}{{/l}}", {"l": [1]}, "no 'x' in the context; it has l"),
        ("{{x}}", {"x": True}, "'x' is of type bool; only a string or an integer can be printed"),
        ("{{x}}", {"x": None}, "'x' is None; only a string or an integer can be printed"),
        ("{{#l}}{{.}}{{/l}}", {"l": [[1]]}, "'l[0]' is of type list; only a string or an integer can be printed"),
        ("{{#x}}a{{/x}}", {"x": "text"}, "'x' is of type str; a section takes a bool, a list, a mapping or None"),
        ("{{#x}}a{{/x}}", {"x": 0}, "'x' is of type int; a section takes a bool, a list, a mapping or None"),
        ("{{x-1}}", {"x": "8"}, "'x' is of type str; -1 can be added only to an integer"),
        ("{{#on}}{{../x}}{{/on}}", {"on": True, "x": 1}, "no scope encloses the context for '../x'"),
        ("{{#m}}{{../x}}{{/m}}", {"m": {"x": 1}}, "no 'x' in the context; it has m"),
        ("{{@last}}", {"x": 1}, "no '@last' in the context; it has x"),
        ("{{> nowhere}}", {}, "cannot read nowhere.mustache: No such file or directory"),
        ("{{#a}}", {"a": True}, 't.vhd.mustache: Unexpected EOF the tag "a" was never closed was opened at line 1'),
    ],
)
def test_what_does_not_fit_is_an_error(expand: Expand, template: str, context: dict[str, object], message: str) -> None:
    with pytest.raises(TemplateError) as raised:
        expand(template, context)
    assert str(raised.value) == f"template t.vhd: {message}"


class Width(IntEnum):
    BYTE = 8


@pytest.mark.parametrize(
    ("template", "value", "kind"),
    [
        ("{{x}}", len, "builtin_function_or_method"),
        ("{{x}}", 1.5, "float"),
        # It would print its name with some versions of Python.
        ("{{x}}", Width.BYTE, "Width"),
        ("{{#x}}{{/x}}", (1, 2), "tuple"),
        ("{{^x}}{{/x}}", 1.5, "float"),
    ],
)
def test_only_plain_data_is_used(expand: Expand, template: str, value: object, kind: str) -> None:
    with pytest.raises(TemplateError, match=f"template t.vhd: 'x' is of type {kind}; "):
        expand(template, {"x": value})


def test_a_missing_template_is_named() -> None:
    with pytest.raises(TemplateError, match=r"template vhdl/nothing: cannot read nothing\.mustache"):
        render("vhdl/nothing", {})


def test_sums_of_integers(expand: Expand) -> None:
    assert expand("({{width-1}} downto {{{low+8}}})", {"width": 8, "low": 0}) == "(7 downto 8)"


def test_the_scope_around(expand: Expand) -> None:
    template = "{{#a}}{{#b}}{{../x}}{{../../x}}{{#../on}}!{{/../on}}{{/b}}{{/a}}"
    assert expand(template, {"x": 1, "a": {"x": 2, "on": True, "b": [{"x": 3}]}}) == "21!"


def test_what_is_there(expand: Expand) -> None:
    template = "{{#x?}}yes {{n}}{{/x?}}{{^x?}}no{{/x?}}"
    present: list[object] = [True, 0, 7, "text", ["a", "b"], {}]
    absent: list[object] = [False, None, "", []]
    assert {expand(template, {"x": value, "n": 1}) for value in present} == {"yes 1"}
    assert {expand(template, {"x": value, "n": 1}) for value in absent} == {"no"}


def test_the_first_and_the_last_turn(expand: Expand) -> None:
    template = "{{#l}}{{#@first}}({{/@first}}{{.}}{{^@last}}, {{/@last}}{{#@last}}){{/@last}}{{/l}}"
    assert expand(template, {"l": ["a", "b", "c"]}) == "(a, b, c)"
    # A mapping within an item has no iterations of its own.
    assert expand("{{#l}}{{#m}}{{x}}{{^@last}},{{/@last}}{{/m}}{{/l}}", {"l": [{"m": {"x": 1}}] * 2}) == "1,1"


def test_columns(expand: Expand) -> None:
    template = "{{#ports}}\n  {{name}}{{|}} : {{type}};{{|}}{{#about?}} -- {{about}}{{/about?}}\n{{/ports}}\n  a : b;\n"
    ports = [{"name": "ready", "type": "bit", "about": "x"}, {"name": "v", "type": "integer", "about": ""}]
    assert expand(template, {"ports": ports}) == "  ready : bit;     -- x\n  v     : integer;\n  a : b;\n"


def test_a_column_behind_some_characters_at_least(expand: Expand) -> None:
    assert expand("{{#l}}\n{{.}}{{|4}}= 0\n{{/l}}\n", {"l": ["a", "bc"]}) == "a   = 0\nbc  = 0\n"
    assert expand("{{#l}}\n{{.}}{{|4}}= 0\n{{/l}}\n", {"l": ["a", "bcdef"]}) == "a    = 0\nbcdef= 0\n"


def test_columns_end_where_a_line_has_none_or_begins_anew(expand: Expand) -> None:
    template = "a{{|}}=\n\n{{#l}}\n{{.}}{{|}}=\n{{/l}}\n{{|!}}b{{|}}=\n"
    assert expand(template, {"l": ["long"]}) == "a=\n\nlong=\nb=\n"
    assert expand(template.replace("{{|!}}", ""), {"l": ["long"]}) == "a=\n\nlong=\nb   =\n"


def test_a_traced_line_is_as_it_is_rendered() -> None:
    """Columns align the text, not the marks in it."""
    context: dict[str, object] = {"ports": [{"formal": "a", "actual": "b"}, {"formal": "long", "actual": "c"}]}
    text = render("partials/port_map", context)
    assert text == "a    => b,\nlong => c\n"
    lines = traced_lines(Rendering("partials/port_map", context))
    assert [line.text for line in lines] == text.splitlines()
    assert [line.scope for line in lines] == ["ports[0]", "ports[1]"]
