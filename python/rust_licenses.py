"""Writes the licences of all Rust packages that are linked into the wheel: python3 python/rust_licenses.py OUT.

Asks cargo which they are. Standard library alone.
"""

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def linked() -> set[str]:
    """`name version` of what is linked: no build scripts, no macros' own dependencies, no tests."""
    words = ["cargo", "tree", "-p", "shutterbug-python", "-e", "normal,no-proc-macro", "--prefix", "none", "--format", "{p}"]
    lines = subprocess.run(words, cwd=ROOT, check=True, capture_output=True, text=True).stdout.splitlines()
    return {" ".join(line.split()[:2]).replace(" v", " ") for line in lines if line}


def main() -> None:
    """Write the file."""
    words = ["cargo", "metadata", "--format-version", "1", "--locked"]
    packages = json.loads(subprocess.run(words, cwd=ROOT, check=True, capture_output=True, text=True).stdout)["packages"]
    wanted, texts, parts = linked(), {}, []
    for package in sorted(packages, key=lambda p: p["name"]):
        if f"{package['name']} {package['version']}" not in wanted or package["source"] is None:
            continue
        folder = Path(package["manifest_path"]).parent
        files = [f for f in sorted(folder.iterdir()) if f.name.upper().startswith(("LICEN", "COPYING", "NOTICE", "UNLICENSE"))]
        numbers = []
        for file in files:
            if file.is_file():
                text = file.read_text("utf-8", "replace").strip()
                numbers.append(texts.setdefault(text, len(texts) + 1))
        stated = ", ".join(f"text {n}" for n in numbers) or "no text in the package"
        parts.append(f"{package['name']} {package['version']}: {package['license']} ({stated})")
    head = "Rust packages that are part of this program, each with its licence. The texts follow, each once.\n\n"
    bodies = [f"\n\n==== text {number} ====\n\n{text}" for text, number in texts.items()]
    Path(sys.argv[1]).write_text(head + "\n".join(parts) + "".join(bodies) + "\n", "utf-8")


if __name__ == "__main__":
    main()
