"""Who may run code: Dask with certificates, warnings, and Slurm scripts that quote every value."""

from __future__ import annotations

import shlex
import socket
import subprocess
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from tests.sweeps.crashes import cases
from tests.sweeps.run_functions import cheap
from trajopt.cli.sweep import app
from trajopt.errors import ArgumentError
from trajopt.sweeps.dask_engines import dask_at, dask_local
from trajopt.sweeps.slurm import SlurmOptions, _script
from trajopt.sweeps.sweeps import sweep


def certificates(folder: Path) -> Path:
    """A folder with an authority and a certificate of it, as the page on sweeps makes them."""
    folder.mkdir()

    def openssl(line: str) -> None:
        subprocess.run(["openssl", *shlex.split(line)], cwd=folder, check=True, capture_output=True)

    openssl("req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=ca -keyout ca.key -out ca.pem")
    openssl("req -newkey rsa:2048 -nodes -subj /CN=dask -keyout key.pem -out cert.csr")
    openssl("x509 -req -days 2 -in cert.csr -CA ca.pem -CAkey ca.key -CAcreateserial -out cert.pem")
    return folder


def hung_up(plain: socket.socket) -> bool:
    """Whether the other side ends the connection (after a few bytes at most, that say why)."""
    said = b""
    try:
        while more := plain.recv(1024):
            said += more
    except ConnectionResetError:
        pass
    return len(said) < 64


def test_dask_lets_only_holders_of_a_certificate_in(tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="distributed is not installed")
    mine, other = certificates(tmp_path / "mine"), certificates(tmp_path / "other")
    engine = dask_local(1, tls=mine)
    store = sweep(cases(5), cheap, executor=engine, store=tmp_path / "store")
    assert store.counts() == {"done": 5}
    with engine.start() as executor:
        address = executor._client.scheduler.address  # type: ignore[attr-defined]
        assert address.startswith("tls://127.0.0.1:")
        assert dask_at(address, tls=mine).workers == 1
        for tls in (other, None):
            with pytest.raises((OSError, TypeError, ValueError, RuntimeError)):
                dask_at(address, tls=tls)
        host, port = address.removeprefix("tls://").split(":")
        with socket.create_connection((host, int(port)), timeout=20) as plain:
            plain.sendall(b"no certificate" * 8)
            assert hung_up(plain)


def test_folders_without_certificates_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=r"a folder with ca\.pem, cert\.pem and key\.pem"):
        dask_local(1, tls=tmp_path)


def test_the_command_warns_of_open_ports(tmp_path: Path) -> None:
    file = tmp_path / "s.toml"
    file.write_text('run = "tests.sweeps.run_functions:cheap"\n[axes.x]\nvalues = [1]\n')

    def run(*options: str) -> Any:
        command = ["run", str(file), "--store", str(tmp_path / "s"), "--workers", "1", *options]
        return CliRunner().invoke(app, command)

    assert "warning" not in run().stderr
    assert "whoever reaches it can run code" in run("--host", "0.0.0.0").stderr
    assert isinstance(run("--tls", str(tmp_path)).exception, ArgumentError)


@pytest.mark.parametrize("name", ["a b", "$(touch x)", "'; touch x; '", "`x`", '"', "é"])
def test_slurm_scripts_quote_every_value(tmp_path: Path, name: str) -> None:
    folder = tmp_path / name
    folder.mkdir()
    script = folder / "array.sh"
    script.write_text(_script(folder).replace("exec ", "exec printf '%s\\n' ", 1))
    done = subprocess.run(
        ["bash", str(script)], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert repr(str(folder)) in done.stdout
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize("value", ["a\nb", "", "\x1b", 3])
def test_slurm_options_are_one_line(value: Any) -> None:
    for name in ("time", "memory", "partition"):
        with pytest.raises(ArgumentError, match=name):
            SlurmOptions(**{name: value})
    with pytest.raises(ArgumentError, match="extra"):
        SlurmOptions(extra=(value,))
