"""An HTML page as a document that tests look through."""

from html.parser import HTMLParser

VOID = frozenset({"meta", "source", "img", "br", "rect", "line", "path", "link", "input"})


class Document(HTMLParser):
    """Every tag with its attributes and its depth, and what is in them."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.text, self.tags, self.open, self.unclosed = text, [], [], []
        self.inside, self._told = [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs), tuple(self.open)))
        if tag not in VOID:
            self.open.append(tag)
            self._told.append([])

    def handle_startendtag(self, tag, attrs):
        self.tags.append((tag, dict(attrs), tuple(self.open)))

    def handle_endtag(self, tag):
        if tag in VOID:
            return
        if not self.open or self.open.pop() != tag:
            self.unclosed.append(tag)
        else:
            self.inside.append((tag, "".join(self._told.pop())))

    def handle_data(self, data):
        for parts in self._told:
            parts.append(data)

    def all(self, *names):
        return [attributes for tag, attributes, _ in self.tags if tag in names]

    def ids(self):
        return [a["id"] for _, a, _ in self.tags if "id" in a]

    def texts(self, *names):
        """The text inside each element of these names, its blanks as they read."""
        return [" ".join(text.split()) for tag, text in self.inside if tag in names]
