"""The server of the pages: one folder, one token, one address; commands that it started go on without it."""

from __future__ import annotations

import secrets
import socket
from collections.abc import Callable, Collection
from pathlib import Path

import uvicorn
from fastapi import FastAPI, Request
from fastapi.responses import FileResponse, PlainTextResponse, Response
from nicegui import ui
from starlette.requests import ClientDisconnect

from rigsight.app.campaign_pages import campaign_page, rig_page
from rigsight.app.file_pages import file_page, files_page
from rigsight.app.gate import Gate
from rigsight.app.result_pages import export_page, result_page
from rigsight.app.steps import SHOWN, Run, Site
from rigsight.app.workspace import inside, opened, receive
from rigsight.errors import InputError, MachineError, RigsightError

_ALONE = {"Content-Security-Policy": "sandbox allow-scripts allow-downloads", "Cache-Control": "no-cache"}
_CLOSING = 1
"""Time [s] that open pages get when the server ends."""


def serve(
    folder: Path, commands: Collection[str], *, host: str, port: int, announce: Callable[[str], None]
) -> None:
    """Show the campaign of a folder until the process is ended; `announce` gets the address with its token."""
    site = Site(opened(folder), commands)
    listening = _listening(host, port)
    own_port = int(listening.getsockname()[1])
    token = secrets.token_urlsafe(32)
    shown_host = f"[{host}]" if ":" in host else host
    gate = Gate(pages(site), token, host, own_port)
    config = uvicorn.Config(gate, log_level="error", timeout_graceful_shutdown=_CLOSING)
    announce(f"http://{shown_host}:{own_port}/?token={token}")
    uvicorn.Server(config).run(sockets=[listening])


def pages(site: Site) -> FastAPI:
    """Return the pages of a folder, its files and its uploads as one application."""
    api = FastAPI(openapi_url=None)

    @api.put("/upload")
    async def upload(request: Request, name: str) -> Response:
        chunks = request.stream()
        size = int(request.headers.get("content-length", 0))
        try:
            kept = await receive(site.root, name, chunks, size)
        except ClientDisconnect:
            return Response(status_code=400)
        except RigsightError as error:
            # A browser reads the answer only once it has sent everything.
            async for _ in chunks:
                pass
            return PlainTextResponse(str(error), 507 if isinstance(error, MachineError) else 409)
        return PlainTextResponse(f"{kept.name}: uploaded.")

    @api.get("/folder/{path:path}")
    def file(path: str) -> Response:
        found = inside(site.root, path)
        if found is None:
            return PlainTextResponse("There is no such file.", 404)
        kind = "inline" if found.suffix in SHOWN else "attachment"
        return FileResponse(found, filename=found.name, content_disposition_type=kind, headers=_ALONE)

    ui.button.default_props("no-caps")
    ui.page("/")(lambda: files_page(site))
    ui.page("/file")(lambda name: file_page(site, name))
    ui.page("/rig")(lambda: rig_page(site))

    async def campaign() -> None:
        await campaign_page(site)

    ui.page("/campaign")(campaign)
    for step in site.runs:
        _add_result(site, step)
    ui.page("/export")(lambda: export_page(site))
    ui.run_with(api, title="rigsight", language="en-US", tailwind=False, show_welcome_message=False)
    return api


def _add_result(site: Site, step: Run) -> None:
    ui.page(f"/{step.key}")(lambda: result_page(site, step))


def _listening(host: str, port: int) -> socket.socket:
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        return socket.create_server((host, port), family=family)
    except (OSError, OverflowError) as error:
        raise InputError(
            f"{host}, port {port} cannot be listened on: {error}. Name another with --port or --host."
        ) from None
