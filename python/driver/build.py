"""Makes the wheel shutterbug-driver out of SwiftShader as tools/drivers unpacks it. Standard library alone.

python3 python/driver/build.py ROOT OUT        ROOT: the unpacked Debian package
"""

import base64
import hashlib
import json
import re
import sys
import zipfile
from pathlib import Path

VERSION = "0.1.0"
HERE = Path(__file__).parent


def needed_glibc(library: Path) -> tuple[int, int]:
    """The newest version of glibc that a library asks for."""
    names = re.findall(rb"GLIBC_(\d+)\.(\d+)", library.read_bytes())
    return max((int(major), int(minor)) for major, minor in names)


def files_of(root: Path) -> dict[str, bytes]:
    """Everything that the wheel holds, but for its own record."""
    library = next(root.rglob("libvk_swiftshader.so"))
    copyright_file = next(root.glob("usr/share/doc/*/copyright"))
    apache = Path("/usr/share/common-licenses/Apache-2.0")
    version = (root / "VERSION").read_text("utf-8") if (root / "VERSION").exists() else "unknown\n"
    icd = json.loads(next(root.rglob("vk_swiftshader_icd.json")).read_text("utf-8"))
    icd["ICD"]["library_path"] = "./libvk_swiftshader.so"
    package, info = "shutterbug_driver", f"shutterbug_driver-{VERSION}.dist-info"
    major, minor = needed_glibc(library)
    tag = f"py3-none-manylinux_{major}_{minor}_x86_64"
    metadata = [
        "Metadata-Version: 2.4",
        "Name: shutterbug-driver",
        f"Version: {VERSION}",
        "Summary: SwiftShader, a Vulkan driver without a GPU, for shutterbug",
        "License-Expression: Apache-2.0",
        "License-File: APACHE-2.0.txt",
        "License-File: DEBIAN-COPYRIGHT.txt",
        "Requires-Python: >=3.11",
        "Description-Content-Type: text/markdown",
        "",
        (HERE / "README.md").read_text("utf-8"),
    ]
    wheel = f"Wheel-Version: 1.0\nGenerator: shutterbug\nRoot-Is-Purelib: false\nTag: {tag}\n"
    found = {
        f"{package}/libvk_swiftshader.so": library.read_bytes(),
        f"{package}/vk_swiftshader_icd.json": json.dumps(icd).encode(),
        f"{package}/SOURCE.txt": f"Debian package chromium-common {version}".encode(),
        f"{info}/METADATA": "\n".join(metadata).encode(),
        f"{info}/WHEEL": wheel.encode(),
        f"{info}/licenses/APACHE-2.0.txt": apache.read_bytes(),
        f"{info}/licenses/DEBIAN-COPYRIGHT.txt": copyright_file.read_bytes(),
        "tag": tag.encode(),
    }
    for file in sorted((HERE / package).glob("*")):
        if file.suffix in (".py", ".typed"):
            found[f"{package}/{file.name}"] = file.read_bytes()
    return found


def main() -> None:
    """Write the wheel and print its path."""
    root, out = Path(sys.argv[1]), Path(sys.argv[2])
    found = files_of(root)
    tag = found.pop("tag").decode()
    out.mkdir(parents=True, exist_ok=True)
    path = out / f"shutterbug_driver-{VERSION}-{tag}.whl"
    record = []
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as wheel:
        for name, content in found.items():
            # One date for all: the same files give the same wheel.
            wheel.writestr(zipfile.ZipInfo(name, (2020, 1, 1, 0, 0, 0)), content, zipfile.ZIP_DEFLATED)
            digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
            record.append(f"{name},sha256={digest},{len(content)}")
        name = f"shutterbug_driver-{VERSION}.dist-info/RECORD"
        wheel.writestr(zipfile.ZipInfo(name, (2020, 1, 1, 0, 0, 0)), "\n".join([*record, f"{name},,"]) + "\n")
    print(path)


if __name__ == "__main__":
    main()
