"""Make keys and certificates for hosts, so that only they can link and each is known.

`lodeline keys init` makes a private authority, `lodeline keys add HOST [ADDRESS ...]` a key and a
certificate for a host; one that listens needs its addresses in it. Copy `ca.pem`, `HOST.pem` and
`HOST.key` to the host, keep `ca.key` to yourself, and write `tls: keys` in the pipeline file.

Exit codes: 0 made, 1 failed, 2 usage.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from lodeline.pipeline.hosts import is_address
from lodeline.pipeline.shape import NAME
from lodeline.terminal.numbers import positive
from lodeline.terminal.parser import VerbParser

EXIT_FAILED = 1


def main(argv: list[str]) -> int:
    """Run `lodeline keys`; the exit code."""
    arguments = parser().parse_args(argv)
    from lodeline.hosts.certificates import CA, KeysError, add, init

    try:
        if arguments.verb == "init":
            name, fingerprint = CA, init(arguments.folder)
        else:
            name = arguments.host
            fingerprint = add(arguments.folder, name, arguments.address, arguments.days)
    except KeysError as error:
        print(error, file=sys.stderr)
        return EXIT_FAILED
    except OSError as error:
        print(f"{error.filename}: {error.strerror}", file=sys.stderr)
        return EXIT_FAILED
    except OverflowError:
        print("--days: no date is so far away", file=sys.stderr)
        return EXIT_FAILED
    except ImportError:
        print("keys need the library cryptography: pip install 'lodeline[tls]'", file=sys.stderr)
        return EXIT_FAILED
    print(f"{arguments.folder / name}.pem  SHA-256 {fingerprint}")
    return 0


def parser() -> argparse.ArgumentParser:
    """What `lodeline keys` takes."""
    parser = VerbParser(
        prog="lodeline keys",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    verbs = parser.add_subparsers(required=True, metavar="VERB", dest="verb")
    common = VerbParser(add_help=False)
    common.add_argument(
        "--folder", type=Path, default=Path("keys"), help="where they are kept (default: keys)"
    )
    verbs.add_parser("init", parents=[common], help="a new authority")
    adding = verbs.add_parser("add", parents=[common], help="key and certificate for a host")
    adding.add_argument("host", type=_host, help="its name in the pipeline file")
    adding.add_argument("address", nargs="*", type=_address, help="on which it listens")
    adding.add_argument("--days", type=positive, default=365.0, help="how long it is valid (365)")
    return parser


def _host(text: str) -> str:
    if not NAME.fullmatch(text):
        what = "must start with a-z and hold only a-z, 0-9, _, -"
        raise argparse.ArgumentTypeError(f"{text!r} {what}, as in the pipeline file")
    return text


def _address(text: str) -> str:
    if not is_address(text):
        what = "is neither an IP address nor the name of a machine (a port does not belong here)"
        raise argparse.ArgumentTypeError(f"{text!r} {what}")
    return text


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
