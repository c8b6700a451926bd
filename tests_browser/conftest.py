"""A browser, the book built from the stored notebooks, and a JupyterLab on a copy of this checkout."""

import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from collections import namedtuple
from pathlib import Path

import pytest

from trackhelpers.suite import NOTEBOOKS, ROOT, book

CHROMIUM = os.environ.get("CHROMIUM") or shutil.which("chromium")
TOKEN = "playgrounds"
SETTINGS = {  # nothing pops up, and every cell is in the page
    "apputils-extension/notification": '{"fetchNews": "false", "checkForUpdates": false, "doNotDisturbMode": true}',
    "notebook-extension/tracker": '{"windowingMode": "none"}',
}


Lab = namedtuple("Lab", "address token")


@pytest.fixture(scope="session")
def browser():
    if not CHROMIUM:
        pytest.skip("chromium is not installed")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def pages(tmp_path_factory):
    """Folder of the book's pages, made from the stored outputs; BOOK= takes one that is built already."""
    if os.environ.get("BOOK"):
        return Path(os.environ["BOOK"])
    out = tmp_path_factory.mktemp("book")
    shutil.copytree(NOTEBOOKS, out / "notebooks", ignore=shutil.ignore_patterns(".*"))
    return book.pages(out / "notebooks", out / "book", with_written=True, with_reference=True).parent


@pytest.fixture(scope="session")
def checkout(tmp_path_factory):
    """A clone of this checkout with its uncommitted changes, whose `git status` is clean."""
    clone = tmp_path_factory.mktemp("clone") / "project"
    env = dict(os.environ)

    def git(*arguments, cwd=ROOT):
        return subprocess.run(["git", *arguments], cwd=cwd, env=env, check=True, capture_output=True, text=True).stdout.strip()

    # An index of its own: whoever works in this checkout meanwhile holds the lock of the other.
    index = shutil.copy(ROOT / git("rev-parse", "--git-path", "index"), clone.with_name("index"))
    env["GIT_INDEX_FILE"] = str(index)
    now = git("stash", "create") or git("rev-parse", "HEAD")
    del env["GIT_INDEX_FILE"]
    git("clone", "--quiet", "--shared", "--no-checkout", str(ROOT), str(clone))
    git("checkout", "--quiet", "--detach", now, cwd=clone)
    assert git("status", "--porcelain", cwd=clone) == ""
    return clone


@pytest.fixture(scope="session")
def lab(checkout, tmp_path_factory):
    """Address and token of a JupyterLab that serves the clone's notebooks on this machine alone."""
    own = tmp_path_factory.mktemp("jupyter")
    for name, text in SETTINGS.items():
        extension, setting = name.split("/")
        path = own / "settings/@jupyterlab" / extension / f"{setting}.jupyterlab-settings"
        path.parent.mkdir(parents=True)
        path.write_text(text, encoding="utf-8")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    folders = {"JUPYTERLAB_SETTINGS_DIR": "settings", "JUPYTERLAB_WORKSPACES_DIR": "spaces", "JUPYTER_CONFIG_DIR": "config"}
    folders |= {"JUPYTER_DATA_DIR": "data", "JUPYTER_RUNTIME_DIR": "runtime"}
    env = os.environ | {name: str(own / folder) for name, folder in folders.items()} | {"PYTHONPATH": str(checkout)}
    options = ["--no-browser", "--ServerApp.ip=127.0.0.1", f"--ServerApp.port={port}", f"--IdentityProvider.token={TOKEN}"]
    command = [sys.executable, "-m", "trackhelpers.suite", "lab", *options]
    with open(own / "log", "w") as log:
        server = subprocess.Popen(command, cwd=checkout, env=env, stdout=log, stderr=subprocess.STDOUT)
    address = f"http://127.0.0.1:{port}"
    try:
        for _ in range(300):
            try:
                urllib.request.urlopen(f"{address}/api?token={TOKEN}", timeout=2).close()
                break
            except OSError:
                assert server.poll() is None, (own / "log").read_text()
                time.sleep(0.2)
        yield Lab(address, TOKEN)
    finally:
        # The suite's command waits for JupyterLab, which ends by its own door.
        request = urllib.request.Request(f"{address}/api/shutdown", method="POST", headers={"Authorization": f"token {TOKEN}"})
        try:
            urllib.request.urlopen(request, timeout=10).close()
            server.wait(30)
        finally:
            if server.poll() is None:
                server.terminate()
                server.wait(30)
