"""What is not hardware is refused with its place and a remedy."""

from __future__ import annotations

import re

import pytest

from fusesoc_firm.compiler.interface import side_of
from fusesoc_firm.compiler.kinds import kind_named
from fusesoc_firm.compiler.program import Task, compile_function
from fusesoc_firm.compiler.source import Source
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.message import ROS2
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.text.diagnostics import InputError
from tests.compiler.compiled import message_frame
from tests.frame.oracle import parsed

SCAN = message_frame(
    "float32 low\nfloat32[] ranges\nfloat32[] heights\nstring name\nint32 n\nfloat64[4] v\nbool p\n"
    "uint8 k\nfloat32 late\n"
)
ANSWER = message_frame(
    "float32 x\nint32 i\nuint8 k\nfloat32[] ranges\nfloat32[] more\nstring name\nuint8[<=2] few\nstring<=3 short\n"
    "string[] names\nPlace[2] corners\n"
)
_LOOP = "made = []\ntotal = 0.0\nfor r in m.ranges:\n    made.append(r)\n    total = total + r\n"

# The body of a function of the message `m`, with '@' before the place of the fault; the message, and the remedy.
BODIES = [
    ("@while m.n > 0:\n    pass", "'while' has no known number of turns", "range.N"),
    ("@try:\n    x = 1\nexcept ValueError:\n    x = 2", "exceptions are not hardware", "'if'"),
    ("@raise ValueError", "exceptions are not hardware", "return None"),
    ("@assert m.n > 0", "'assert' is not hardware", "return None"),
    ("@with open('x') as f:\n    pass", "'with' is not hardware", "remove it"),
    ("@global count\ncount = 1", "cannot change a global name", "self"),
    ("@del m.n", "'del' is not hardware", "fixed size"),
    ("@import math", "an import within a function", "top of the file"),
    ("@class A:\n    pass", "a class within a function", "top of the file"),
    ("@def inner():\n    return 1", "a function within a function", "top of the file"),
    ("@match m.n:\n    case 1:\n        pass", "'match' is not hardware", "'elif'"),
    ("@yield 1", "a generator is not hardware", "append"),
    ("x = @{1, 2}", "a set is not hardware", "list"),
    ("x = @{i: i for i in range(2)}", "a dictionary of computed keys", "name the fields"),
    ("x = @f'{m.n}'", "a text cannot be computed", "pass a text"),
    ("if (@x := m.n) > 1:\n    pass", "':=' is not hardware", "line of its own"),
    ("x = max(@*m.v)", "'*' is not hardware here", "name the elements"),
    ("x = @m.v @ m.v", "a list is not a number", ""),
    ("x = @m.n / 'a'", "a text is not a number", ""),
    ("x = @m.n % 0", "a division by zero", "another number"),
    ("x = @m.low // m.n", "'//' and '%' of floats are not hardware", "math.floor"),
    ("x = @m.low % 2.0", "'//' and '%' of floats", "math.floor"),
    ("x = @m.low ** m.low", "the exponent of '**' must be a constant", "product"),
    ("x = @m.low ** 0.3", "'** 0.3' is not hardware", "legal exponents"),
    ("x = @m.n << m.n", "the number of bits of a shift must be a constant", "range"),
    ("x = @~m.p", "'~' of a bool", "'not'"),
    ("x = @-m.p", "a truth value has no negative", "'not'"),
    ("x = @m.p + m.p", "a truth value is not a number here", "int()"),
    ("x = @m.low & 1", "there is no such operation on a float32 and a int", "int()"),
    ("x = @m.n + 3000000000", "out of the range of int32", "NumPy"),
    ("x = @math.gamma(m.low)", "'math.gamma' is not hardware", "legal here: acos"),
    ("x = @math.sqrt(m.low, 2)", "'math.sqrt' takes 1 numbers", ""),
    ("x = @wave.open(m.low)", "'wave.open' is not hardware", "^legal here: functions of this file, of math and of"),
    ("x = @xml.dom.getDOMImplementation(m.low)", "'xml.dom.getDOMImplementation' is not hardware", "of this file"),
    ("x = @minidom.parse(m.low)", "'xml.dom.minidom.parse' is not hardware", "of this file"),
    ("x = @xml.sax.parse(m.low)", "'xml.sax.parse' is not hardware", "of this file"),
    ("x = @print(m.n)", "'print' is not hardware", "remove it"),
    ("x = @math.clip(m.low, 1.0, 2.0)", "'math.clip' is not hardware", r"use 'min\(max"),
    ("x = @math.inf // m.n", "'//' and '%' of floats", "math.floor"),
    ("x = @missing + 1", "the name 'missing' has no value", ""),
    ("x = [1.0 + @scale for r in m.ranges]", "the name 'scale' has no value", "^legal here: [a-z, ]*\\bm\\b"),
    ("x = [r * @scale.y[0] for r in m.v]", "the name 'scale' has no value", "^legal here: [a-z, ]*\\bm\\b"),
    ("x = sum(r * @scale for r in m.ranges)", "the name 'scale' has no value", "^legal here: [a-z, ]*\\bm\\b"),
    ("x = @m.lwo", "the message has no field 'lwo'", "did you mean 'low'"),
    ("x = m[@'lwo']", "the message has no field 'lwo'", "did you mean 'low'"),
    ("x = @m.ranges[2]", "an array of variable size is not stored", "loop over the array"),
    ("for a, b in zip(@m.ranges, m.heights):\n    pass", "an array of variable size is read once", "loop over"),
    ("for r in m.ranges:\n    pass\n@for r in m.ranges:\n    pass", "'ranges' is read twice", "one loop"),
    ("for r in m.ranges:\n    @for h in m.heights:\n        pass", "a loop over an array within another one", ""),
    ("for r in m.ranges:\n    if r > 1.0:\n        @break", "'break' in a loop over an array", "'if'"),
    ("for r in m.ranges:\n    if r > 1.0:\n        @return None", "'return' within a loop over an array", "set a name"),
    ("for c in @m.name:\n    pass", "'name' can only be passed on", "array of numbers"),
    ("for i in range(@m.n):\n    pass", "the number of turns is not a constant", "constant limit"),
    ("for i in range(2):\n    pass\nelse:\n    @pass", "'else' after a loop", "'break'"),
    ("for i in @range(5000):\n    pass", "a loop of 5000 turns is too long", "at most 4096"),
    ("if m.p:\n    x = 1\ny = @x + 1", "'x' has no value on one of the paths", "before the 'if'"),
    ("@if m.p:\n    x = 1\nelse:\n    x = (1, 2)", "two paths leave a int and a tuple of 2", "same type"),
    ("x = m.n if m.p else m.low\ny = @x >> 1", "there is no such operation on a float32 and a int", "int()"),
    ("x = m.n if m.p else m.low\ny = @x @ x", "'@' is not hardware", "sums of products"),
    ("x = m.n if m.p else m.p\ny = @x + m.p", "a truth value is not a number here", "int()"),
    ("x = m.n if m.p else m.low\ny = m.v[@x]", "an index must be an integer", "int()"),
    ("x = @min(m.ranges)", "the array 'ranges' may be empty, and then 'min' has no result", "default=math.inf"),
    ("x = min(m.low, 1.0, @default=1.0)", "'min' has no such parameter", "in order"),
    ("x = @Twist()", "the name 'Twist' has no value", "a message is a dictionary"),
    ("x = m.n\n@for r in m.ranges:\n    x = r", "two paths leave a int32 and a float32", "same type"),
    (
        "for r in m.ranges:\n    pass\nfor r in m.heights:\n    x = r\ny = @r + 1",
        "'r' has no value on one of",
        "before",
    ),
    ("n = m.n * 2\nx = 'a'\nfor x in m.ranges:\n    pass\ny = @x", "'x' has no value on one of the paths", "before"),
    ("k = len(m.ranges)\n@for h in m.heights:\n    k = k + m.k", "a int of Python and a uint8", "int\\(\\)"),
    ("x = @'a' < 'b'", "a text cannot be compared", ""),
    ("x = @m.n is m.n", "'is' is not hardware", "'=='"),
    ("x = m.v[@7]", "7 is not an index of 4 elements", ""),
    ("x = m.v[@m.low]", "an index must be an integer", "int()"),
    ("x = @(lambda y: y)(1, 2)", "'lambda' has no parameter", ""),
    ("x = @helper()", "'helper' needs a value for 'y'", ""),
    ("x = @1j", "is not a number of hardware", "64 bits"),
    ("x = @m.items()", "'items' of a message is not hardware", "name the fields"),
]
RETURNS = [
    ("return @1", "the function returns a int, not a message", "'field'"),
    ("return {'y': 1}", "the answer has no field 'y'", ""),
    ("return {'i': m.low}", "'i' is an integer \\(int32\\), and the answer is a float32", "round\\(\\)"),
    (
        "return {'i': m.low if m.p else m.k}",
        "'i' is an integer .*, and the answer is a float32 or uint8",
        "round\\(\\)",
    ),
    ("return {'ranges': m.low}", r"'ranges' is of type float32\[\], and the answer gives a float32", "append"),
    ("return {'ranges': 'a'}", r"'ranges' is of type float32\[\], and the answer gives a text", "a list"),
    ("return {'ranges': {'x': 1.0}}", r"'ranges' is of type float32\[\], and the answer gives a message", "a list"),
    ("return {'names': {'x': 1.0}}", r"'names' is of type string\[\], and the answer gives a message", "a list"),
    ("return {'corners': {'x': 1.0}}", "'corners' is an array of 2 messages, and the answer gives a message", "a list"),
    ("return {'corners': [{'x': 1.0}, {'z': 1.0}]}", r"the answer has no field 'corners\.z'", "legal here: x, y"),
    ("return {'x': {'y': 1.0}}", "'x' is of type float32, and the answer gives a message", "a number"),
    ("return {'name': {'y': 1.0}}", "'name' is of type string, and the answer gives a message", "a text"),
    ("return {'name': [1]}", "'name' is a text, not an array", "a text"),
    ("return {'few': [1, 2, 3]}", "'few' has at most 2 elements, and the answer has 3", "fewer"),
    ("return {'short': 'abcd'}", "'short' has at most 3 elements, and the answer has 4", "fewer"),
    ("return {'names': ['a']}", "'names' is an array of texts", "leave it out"),
    ("return {'corners': [{'x': 1.0}]}", "'corners' has 2 elements, and the list has 1", "a list of 2"),
    ("return {'ranges': [1.0] if m.p else [1.0, 2.0]}", "a list and another one with another number", ""),
    (
        _LOOP + "for h in m.heights:\n    total = total + h\nreturn {'ranges': [total], 'more': made}",
        "'ranges' precedes 'more' in the answer, and depends on what follows 'ranges'",
        "comes earlier",
    ),
    ("return {'ranges': m.name}", r"'ranges' is of type float32\[\], and .* gives 'name' of the message", "append"),
    ("return {'ranges': m.ranges, 'more': m.ranges}", "'ranges' is sent twice", "one place"),
    ("return {'ranges': m.heights, 'more': m.ranges}", "'ranges' precedes 'more' in the answer", "one of both"),
    ("x = 0.0\nfor r in m.ranges:\n    x = x + r * m.late\nreturn {'x': x}", "needs 'late', which follows", "earlier"),
    ("return {'ranges': [r * m.late for r in m.ranges]}", "needs 'late', which follows", "earlier"),
    (
        "y = 0.0\nfor h in m.heights:\n    y = y + h\nx = y\nfor r in m.ranges:\n    x = x + r\nreturn {'x': x}",
        "the loop over 'ranges' needs 'y', which follows",
        "earlier",
    ),
    (_LOOP + "return {'more': m.ranges}", "'ranges' is read by a loop and passed on", "append"),
    (_LOOP + "return {'ranges': made, 'x': total}", "'x' precedes 'ranges' in the answer", "comes earlier"),
    (_LOOP + "if total > 1.0:\n    return None\nreturn {'ranges': made}", "the condition of the answer", "earlier"),
]
_HEAD = """import math
import wave
import xml.dom
import xml.sax
import xml.dom.minidom as minidom


def helper(y):
    return y


def again(y):
    return again(y)


def tried(m):
"""


def compiled(body: str, length: str = "buffered", numbers: str = "") -> None:
    text = _HEAD + "".join(f"    {line}\n" for line in body.split("\n"))
    sides = [side_of("in_", SCAN)], [side_of("out_", ANSWER, length)]
    compile_function(Task(Source("tried.py", text), "tried", *sides, kind_named(numbers)))


@pytest.mark.parametrize(("body", "message", "remedy"), BODIES)
def test_a_construct_is_refused_at_its_place(body: str, message: str, remedy: str) -> None:
    mark = body.index("@")
    text = body[:mark] + body[mark + 1 :]
    with pytest.raises(InputError) as raised:
        compiled(f"{text}\nreturn {{}}")
    (fault,) = raised.value.diagnostics
    assert message in fault.message
    assert re.search(remedy, fault.hint), fault.hint
    assert fault.source is not None
    lines = body[:mark].split("\n")
    head = _HEAD.count("\n")
    assert (fault.source.line, fault.source.column) == (head + len(lines), 5 + len(lines[-1]))


@pytest.mark.parametrize(("body", "message", "remedy"), RETURNS)
def test_an_answer_is_refused(body: str, message: str, remedy: str) -> None:
    with pytest.raises(InputError) as raised:
        compiled(body.replace("@", ""))
    (fault,) = raised.value.diagnostics
    assert re.search(message, fault.message), fault.message
    assert re.search(remedy, fault.hint), fault.hint


@pytest.mark.parametrize(
    ("length", "answer", "message"),
    [
        ("computed", "{'ranges': m.ranges, 'more': m.heights}", "the length of 'more' precedes 'ranges'"),
        ("given", "{'ranges': m.ranges, 'name': m.name}", "'more' has another length"),
    ],
)
def test_a_length_that_comes_late_is_refused(length: str, answer: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as raised:
        compiled(f"return {answer}", length)
    assert "length: buffered" in raised.value.diagnostics[0].hint


@pytest.mark.parametrize(
    ("answer", "absent", "remedy"),
    [
        ("{'names': scan.names}", "label", r'write "label": scan\.label; '),
        ("{'label': {}, 'names': scan.names}", "label.text", r"""write "text": scan\.label\.text in 'label'; """),
        ("{'label': scan.label}", "names", r'write "names": scan\.names; '),
    ],
)
def test_what_an_answer_lacks_is_named_at_its_return(answer: str, absent: str, remedy: str) -> None:
    texts = {"test_msgs/Labelled": "Label label\nstring[] names\n", "test_msgs/Label": "int32 id\nstring text\n"}
    frame = frame_of(parse_name("test_msgs/Labelled"), parsed(texts, ROS2))
    text = f"def f(scan):\n    if scan.label.id < 0:\n        return None\n    return {answer}\n"
    task = Task(Source("f.py", text), "f", [side_of("in_", frame)], [side_of("out_", frame, "given")])
    with pytest.raises(InputError, match=rf"^f\.py:4:12: error: the answer has no '{absent}', so its length") as raised:
        compile_function(task)
    assert re.match(remedy + "if it shall be empty, .*'length: buffered'", raised.value.diagnostics[0].hint)


@pytest.mark.parametrize(
    ("expression", "message"),
    [
        ("m.low * 1000.0", r"1000.0 is out of the range of fixed\(12, 4\), -128.0 to 127.9375"),
        ("m.low + 300", "300 is out of the range of"),
        ("m.n / 3", "a quotient of integers is not a fixed-point number"),
        ("m.n ** -2", "a quotient of integers is not a fixed-point number"),
        ("~m.low", r"'~' of a fixed\(12, 4\) is not hardware"),
        ("m.low << 2", "there is no such operation on a fixed"),
        ("m.low // 2", "there is no such operation on a fixed"),
        ("m.low & 3", "there is no such operation on a fixed"),
        ("m.v[m.low]", "an index must be an integer"),
    ],
)
def test_what_fixed_point_numbers_do_not_hold_is_refused(expression: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as raised:
        compiled(f"return {{'x': {expression}}}", numbers="fixed(12, 4)")
    assert raised.value.diagnostics[0].hint


@pytest.mark.parametrize(
    ("first", "later", "message"),
    [
        ("pass", "m.low", r"'state.x' has no value before the first message"),
        ("self.x = None", "m.low", r"'state.x' is None at first, and a state is a number"),
        ("self.x = numpy.float32(0.0)", "m.v[0]", r"'state.x' is a float32 and a float64"),
        ("self.x = numpy.float32(0.0)", "min(m.low, m.v[0])", r"'state.x' is a float32 and a float64"),
        ("self.x = numpy.float32(0.0)", "min(m.low, 1.2)", r"'state.x' is 1.2, which is not an exact float32"),
    ],
)
def test_a_state_is_refused_where_it_is_set(first: str, later: str, message: str) -> None:
    text = f"import numpy\n\nclass State:\n    def __init__(self):\n        {first}\n"
    text += f"    def __call__(self, m):\n        self.x = {later}\n        return {{}}\n\nstate = State()\n"
    sides = [side_of("in_", SCAN)], [side_of("out_", ANSWER, "buffered")]
    with pytest.raises(InputError, match=rf"state\.py:7:9: error: {message}"):
        compile_function(Task(Source("state.py", text), "state", *sides, kind_named("")))


@pytest.mark.parametrize(
    ("first", "change", "column"),
    [
        ("self.kept = []", "self.kept.append(m.low)", 9),
        ("self.kept = []", "self.kept.append({'x': m.low})", 9),
        ("self.kept = [0.0]", "self.n = self.kept.append(m.low)", 18),
        ("self.kept = [[0.0], [1.0]]", "self.kept[0].append(m.low)", 9),
        ("self.kept = []", "self.kept = self.kept + [m.low]", 9),
        ("pass\n    kept = []", "self.kept.append(m.low)", 9),
    ],
)
def test_a_list_that_grows_is_refused_where_it_grows(first: str, change: str, column: int) -> None:
    text = f"class Last:\n    def __call__(self, m):\n        {change}\n        return {{}}\n\n"
    text += f"    def __init__(self):\n        {first}\n\nlast = Last()\n"
    sides = [side_of("in_", SCAN)], [side_of("out_", ANSWER, "buffered")]
    place = rf"last\.py:3:{column}: error: 'last\.kept(\[0\])?' grows with each message"
    with pytest.raises(InputError, match=place) as raised:
        compile_function(Task(Source("last.py", text), "last", *sides, kind_named("")))
    assert "fixed size" in raised.value.diagnostics[0].hint


def test_a_recursion_is_refused_at_its_call() -> None:
    with pytest.raises(InputError, match=r"tried\.py:13:12: error: a recursion is not hardware"):
        compiled("x = again(1)\nreturn {}")


@pytest.mark.parametrize("body", ["[r * scale for r in m.ranges]", "min((scale for r in m.ranges), default=1.0)"])
def test_the_mark_of_a_name_is_as_long_as_the_name(body: str) -> None:
    with pytest.raises(InputError) as raised:
        compiled(f"x = {body}\nreturn {{}}")
    (fault,) = raised.value.diagnostics
    assert fault.source is not None
    assert (fault.source.column, fault.source.width) == (9 + body.index("scale"), len("scale"))


def test_more_than_forty_constructs_are_refused() -> None:
    assert len(BODIES) + len(RETURNS) >= 60
