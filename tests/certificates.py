"""Certificates for the machines of a cluster, made by openssl, and Dask's configuration with them."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

needs_openssl = pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl is not installed")


def write_certificates(folder: Path) -> None:
    """Write an authority `ca`, its certificate `node` for all machines of a cluster, and `stranger` of another one."""
    new_key = ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "1"]
    for name in ("ca", "other"):
        command = [
            "openssl",
            "req",
            "-x509",
            *new_key,
            "-keyout",
            f"{name}.key",
            "-out",
            f"{name}.pem",
            "-subj",
            f"/CN={name}",
        ]
        subprocess.run(command, cwd=folder, check=True, capture_output=True)
    for name, authority in (("node", "ca"), ("stranger", "other")):
        request = ["openssl", "req", *new_key, "-keyout", f"{name}.key", "-out", f"{name}.csr", "-subj", f"/CN={name}"]
        subprocess.run(request, cwd=folder, check=True, capture_output=True)
        sign = [
            "openssl",
            "x509",
            "-req",
            "-in",
            f"{name}.csr",
            "-CA",
            f"{authority}.pem",
            "-CAkey",
            f"{authority}.key",
        ]
        sign += ["-CAcreateserial", "-out", f"{name}.pem", "-days", "1"]
        subprocess.run(sign, cwd=folder, check=True, capture_output=True)


def tls_files(folder: Path, name: str, authority: str) -> dict[str, str]:
    """Return the keys of `distributed.comm.tls` in Dask's configuration, the same on every machine of a cluster."""
    files = {"ca-file": str(folder / f"{authority}.pem")}
    for role in ("client", "scheduler", "worker"):
        files |= {f"{role}.cert": str(folder / f"{name}.pem"), f"{role}.key": str(folder / f"{name}.key")}
    return files
