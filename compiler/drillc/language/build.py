"""Lark's tree → the syntax tree of `ast`: a visitor with one small method a rule."""

from __future__ import annotations

from lark import Token, Tree

from drillc.language import ast
from drillc.language.source import Source, Span

Node = Tree[Token] | Token | None


class Builder:
    """Builds the syntax tree of one source."""

    def __init__(self, source: Source) -> None:
        self.source = source

    def spec(self, tree: Tree[Token]) -> ast.SpecFile:
        """The whole file; `version` is kept as a statement so that its number can be checked."""
        return ast.SpecFile(
            self.source, tuple(self.statement(_tree(child)) for child in tree.children)
        )

    def statement(self, tree: Tree[Token]) -> ast.Statement:
        """A statement is named by its first NAME; blocks become items, the rest values."""
        kind = str(tree.data)
        span = self.tree_span(tree)
        name = ast.Word(kind, self.first_word(tree))
        values: list[ast.Value] = []
        items: list[ast.Item] = []
        children = list(tree.children)
        if kind == "skip":
            return ast.Statement(kind, name, (self.select(tree),), (), span)
        for position, child in enumerate(children):
            if isinstance(child, Token) and child.type in {"NAME", "HOLE_ID"} and position == 0:
                name = self.word(child)
            elif isinstance(child, Tree) and str(child.data) not in _VALUES:
                items.append(self.item(child))
            else:
                values.append(self.value(child))
        return ast.Statement(kind, name, tuple(values), tuple(items), span)

    def item(self, tree: Tree[Token]) -> ast.Item:
        """An item's key is its keyword, or its NAME where the rule begins with one."""
        rule = str(tree.data)
        span = self.tree_span(tree)
        if rule == "select":
            return ast.Item(ast.Word(rule, self.first_word(tree)), (self.select(tree),), span)
        if rule == "points":
            return ast.Item(ast.Word(rule, self.first_word(tree)), (self.points(tree),), span)
        key = ast.Word(_KEYS.get(rule, rule), self.first_word(tree))
        children = list(tree.children)
        if rule in _NAMED_ITEMS:
            key = self.word(_token(children.pop(0)))
        items = [self.item(c) for c in children if isinstance(c, Tree) and c.data in _NESTED]
        rest = [c for c in children if not (isinstance(c, Tree) and c.data in _NESTED)]
        return ast.Item(key, tuple(self.value(c) for c in rest), span, tuple(items))

    def value(self, node: Node) -> ast.Value:
        """One value of an item or statement."""
        if node is None:
            return None
        if isinstance(node, Token):
            if node.type == "STRING":
                return self.text(node)
            if node.type == "NUMBER":
                return ast.Quantity(str(node), None, self.token_span(node))
            return self.word(node)
        rule = str(node.data)
        if rule == "quantity":
            return self.quantity(node)
        if rule == "number":
            return ast.Quantity(str(node.children[0]), None, self.tree_span(node))
        if rule in {"triple", "vector"}:
            return self.numbers(node)
        if rule == "direction":
            return self.direction(node)
        if rule == "range":
            return self.range(node)
        if rule == "placement":
            return self.placement(node)
        if rule == "orientation":
            return self.orientation(node)
        if rule == "rule":
            return self.rule(node)
        raise AssertionError(f"no value for rule {rule}")

    # ── leaves ──────────────────────────────────────────────────────────────────────────────────

    def token_span(self, token: Token) -> Span:
        start = token.start_pos or 0
        return self.source.span(start, start + len(token))

    def tree_span(self, tree: Tree[Token]) -> Span:
        return self.source.span(tree.meta.start_pos, tree.meta.end_pos)

    def first_word(self, tree: Tree[Token]) -> Span:
        """The span of the word with which a rule begins (its keyword)."""
        start = tree.meta.start_pos
        end = start
        while end < len(self.source.text) and (
            self.source.text[end].isalnum() or self.source.text[end] == "_"
        ):
            end += 1
        return self.source.span(start, max(end, start + 1))

    def word(self, token: Token) -> ast.Word:
        return ast.Word(str(token), self.token_span(token))

    def text(self, token: Token) -> ast.Text:
        return ast.Text(str(token)[1:-1], self.token_span(token))

    def quantity(self, tree: Tree[Token]) -> ast.Quantity:
        number, unit = tree.children
        return ast.Quantity(str(number), None if unit is None else str(unit), self.tree_span(tree))

    def numbers(self, tree: Tree[Token]) -> ast.Numbers:
        unit = None
        triple = tree
        if tree.data == "vector":
            triple, unit = _tree(tree.children[0]), tree.children[1]
        tokens = [_token(_tree(child).children[0]) for child in triple.children]
        return ast.Numbers(
            tuple(map(str, tokens)),
            None if unit is None else str(unit),
            self.tree_span(tree),
            tuple(map(self.token_span, tokens)),
        )

    def direction(self, tree: Tree[Token]) -> ast.Word | ast.Numbers:
        child = tree.children[0]
        return self.word(child) if isinstance(child, Token) else self.numbers(child)

    def range(self, tree: Tree[Token]) -> ast.Range:
        low, high = (self.quantity(_tree(child)) for child in tree.children)
        return ast.Range(low, high, self.tree_span(tree))

    def placement(self, tree: Tree[Token]) -> ast.Placement:
        at, orientation = map(_tree, tree.children)
        return ast.Placement(self.numbers(at), self.orientation(orientation))

    def orientation(self, tree: Tree[Token]) -> ast.Orientation:
        axes, *rotations = tree.children
        return ast.Orientation(
            None if axes is None else self.frame_axes(_tree(axes)),
            tuple(self.rotation(_tree(rotation)) for rotation in rotations),
        )

    def frame_axes(self, tree: Tree[Token]) -> ast.FrameAxes:
        x, y, z = (self.numbers(_tree(child)) for child in tree.children)
        return ast.FrameAxes((x, y, z), self.tree_span(tree))

    def rotation(self, tree: Tree[Token]) -> ast.Rotation:
        axis, angle = tree.children
        return ast.Rotation(self.word(_token(axis)), self.quantity(_tree(angle)))

    def rule(self, tree: Tree[Token]) -> ast.Rule:
        axis, *rest = tree.children
        horizontal = isinstance(rest[0], Token)
        toward, cone = rest[-2:]
        return ast.Rule(
            self.word(_token(axis)),
            horizontal,
            None if toward is None or isinstance(toward, Token) else self.direction(toward),
            None if cone is None else self.quantity(_tree(cone)),
            self.tree_span(tree),
        )

    def points(self, tree: Tree[Token]) -> ast.PointBlock:
        unit, block = tree.children
        token = _token(block)
        start = (token.start_pos or 0) + 1
        return ast.PointBlock(
            self.source,
            start,
            start + len(token) - 2,
            None if unit is None else self.word(_token(unit)),
            self.first_word(tree),
        )

    # ── conditions ──────────────────────────────────────────────────────────────────────────────

    def select(self, tree: Tree[Token]) -> ast.Select:
        table, membership, condition = tree.children
        built = None if condition is None else self.condition(_tree(condition))
        if membership is not None:
            negated, region = _tree(membership).children
            member: ast.Condition = ast.Member(self.word(_token(region)))
            member = member if negated is None else ast.Not(member)
            built = member if built is None else ast.Both((member, built))
        return ast.Select(self.word(_token(table)), built, self.tree_span(tree))

    def condition(self, tree: Tree[Token]) -> ast.Condition:
        rule, children = str(tree.data), tree.children
        if rule in {"either", "both"}:
            terms = tuple(self.condition(_tree(term)) for term in children)
            return ast.Either(terms) if rule == "either" else ast.Both(terms)
        if rule == "negation":
            *negations, inner = children
            built = self.condition(_tree(inner))
            return ast.Not(built) if len(negations) % 2 else built
        first = self.word(_token(children[0]))
        if rule == "member":
            return ast.Member(first)
        if rule == "between":
            return ast.Between(first, self.range(_tree(children[1])))
        if rule == "like":
            return ast.Like(first, self.text(_token(children[1])))
        value = _tree(children[2])
        return ast.Compare(
            first,
            str(children[1]),
            self.quantity(value)
            if value.data == "quantity"
            else self.text(_token(value.children[0])),
        )


#: Rules that are values of a statement, not items of its block.
_VALUES = {"number", "quantity", "triple", "vector", "placement", "direction", "range"}
#: Rules whose item is named by what the user wrote, not by a keyword.
_NAMED_ITEMS = {
    *("limit", "joint_speed", "joint_angle", "dimension", "weight"),
    *("signal", "column", "axis", "setting"),
}
#: Items within items.
_NESTED = {
    *("limit", "joint_speed", "joint_angle", "dimension", "weight", "link"),
    *("box", "sphere", "capsule", "cylinder", "mesh"),
    *("column", "axis", "stack", "sink_by", "sink_diameter"),
}
#: Rule names that differ from the keyword the user wrote.
_KEYS = {
    "portal_d_big": "D",
    "portal_h_big": "H",
    "portal_d": "d",
    "tool_number": "number",
    "use_process": "process",
    "use_station": "station",
    "base_at": "base",
    "base_auto": "base",
    "sink_by": "by",
    "sink_diameter": "diameter",
}


def _tree(node: Node) -> Tree[Token]:
    assert isinstance(node, Tree)
    return node


def _token(node: Node) -> Token:
    assert isinstance(node, Token)
    return node
