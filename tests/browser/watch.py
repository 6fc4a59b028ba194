"""A page that is watched: whatever it says, asks for or breaks is noted, and must be nothing."""

# Violations of the policy are events of the document; this says them where all else is said.
_POLICY = """document.addEventListener('securitypolicyviolation', e => console.error(
  `policy violated: ${e.violatedDirective} ${e.blockedURI} ${e.sample}`));"""
#: Nothing that is asked of a page from the disk takes so long, on a busy machine either.
_PATIENCE_MS = 20_000
#: What a page may say: nobody must look after it.
_HARMLESS = ("log", "debug", "info", "startGroup", "endGroup")


class Watched:
    """One page in a context of its own.

    Attributes:
        page: Playwright's.
        noted: what it should not have done, in order.
    """

    def __init__(self, browser, path, **options):
        self.url = path.resolve().as_uri()
        self.noted: list[str] = []
        self.context = browser.new_context(**options)
        self.context.set_default_timeout(_PATIENCE_MS)
        if options.get("java_script_enabled", True):
            self.context.add_init_script(_POLICY)
        self.context.route("**/*", self._route)
        self.context.on("page", self._watch)
        self.page = self.context.new_page()

    def open(self, fragment=""):
        """Load the report, at a moment where a fragment is given."""
        self.page.goto(self.url + fragment)
        return self.page

    def close(self):
        self.context.close()

    def _watch(self, page):
        if len(self.context.pages) > 1:
            self.noted.append("another page was opened")
        page.on("console", self._console)
        page.on("pageerror", lambda error: self.noted.append(f"error: {error}"))
        page.on("dialog", self._dialog)
        page.on("download", lambda download: self.noted.append(f"download of {download.url}"))
        page.on("websocket", lambda socket: self.noted.append(f"socket to {socket.url}"))

    def _console(self, message):
        if message.type not in _HARMLESS:
            self.noted.append(f"console {message.type}: {message.text}")

    def _dialog(self, dialog):
        self.noted.append(f"dialog: {dialog.message}")
        dialog.dismiss()

    def _route(self, route):
        asked = route.request.url
        if asked.partition("#")[0] == self.url or asked.startswith("data:"):
            route.continue_()
        else:
            self.noted.append(f"request of {asked}")
            route.abort()
