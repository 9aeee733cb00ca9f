"""Writing files whole or not at all, and what becomes of a file that is there already.

By itself a write replaces it. The command line keeps it once, as NAME.previous, or refuses.
"""

from __future__ import annotations

import contextlib
import csv
import errno
import filecmp
import io
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator, Mapping
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Final, cast

from flexspline.errors import InputError

if TYPE_CHECKING:
    import pandas
    from numpy.typing import NDArray

__all__ = [
    "PREVIOUS",
    "RECORDING",
    "Writing",
    "atomic_write",
    "atomic_writer",
    "file_to_write",
    "folder_to_write",
    "refuse_special",
    "remove_file",
    "require_there",
    "save_columns",
    "save_table",
    "text_of",
    "whole_folder",
    "write_columns",
    "writing",
]


FULL: Final = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""What the system says where a disk is full, a quota used up, a file too large, a disk broken; it
does not say of which file."""


PREVIOUS: Final = ".previous"
RECORDING: Final = "metadata.yaml"
"""A folder with this file is one recording: a bag of ROS 2."""
ROWS_AT_ONCE: Final = 50_000


@dataclass
class Writing:
    """What is to become of files that are there, and what was written.

    Parameters
    ----------
    keep : whether a file that is replaced by another content stays beside it as NAME.previous.
    refuse : whether a file that is there is refused instead.
    written : files, in the order in which they were written.
    kept : names under which files stayed.
    """

    keep: bool = False
    refuse: bool = False
    written: list[Path] = field(default_factory=list)
    kept: list[Path] = field(default_factory=list)

    @staticmethod
    def current() -> Writing:
        """Return what counts now: by itself files are replaced."""
        return _WRITING.get(None) or Writing()

    def before(self, target: Path) -> None:
        """Refuse a file that is there, where that is asked for.

        Raises
        ------
        InputError
            Where it is there, and not from this call itself.
        """
        if self.refuse and target.exists() and target not in self.written:
            raise InputError(
                f"{target}: is there already; give another name, or leave --no-overwrite out"
            )

    def removes(self, target: Path) -> None:
        """Note that a file is about to go, and keep it by another name."""
        if self.keep:
            self.kept.append(_kept(target))

    def replaces(self, draft: Path, target: Path) -> None:
        """Note that a file is about to be written, and keep what is there by another name.

        What this call has written itself is not kept: it would take the place of what was there.
        """
        self.before(target)
        if target in self.written:
            return
        if self.keep and target.is_file() and not filecmp.cmp(draft, target, shallow=False):
            self.kept.append(_kept(target))
        self.written.append(target)


_WRITING: ContextVar[Writing] = ContextVar("writing")


def _kept(target: Path) -> Path:
    """Copy a file to NAME.previous, whole, and return that name."""
    previous = target.with_name(target.name + PREVIOUS)
    handle, copy = _draft_file(previous, [])
    os.close(handle)
    try:
        shutil.copy2(target, copy)
        _rename(copy, previous)
    except BaseException:
        copy.unlink(missing_ok=True)
        raise
    return previous


@contextlib.contextmanager
def writing() -> Iterator[Writing]:
    """Let files that are replaced inside stay as NAME.previous; gives what is written."""
    token = _WRITING.set(Writing(keep=True))
    try:
        yield _WRITING.get()
    finally:
        _WRITING.reset(token)


@contextlib.contextmanager
def atomic_writer(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Open a binary file that appears at `path` when the block ends without an error.

    It is written beside its destination, flushed to the disk and then renamed over it, so
    a reader (or a power cut) finds the old file or the new one, never a part. After an
    error the old file is untouched and nothing is left behind. A folder that is not there is
    made; a symbolic link stays, and the file that it leads to is written.

    Raises
    ------
    InputError
        Where the folder cannot be written to, or what is there is a device or a pipe.
    """
    target = file_to_write(path)
    made = [folder for folder in target.parents if not folder.exists()]
    handle, draft = _draft_file(target, made)
    try:
        with os.fdopen(handle, "wb") as file:
            yield cast(BinaryIO, file)
            file.flush()
            os.fsync(file.fileno())
        draft.chmod(_usual_mode(target))
        Writing.current().replaces(draft, target)
        _rename(draft, target)
    except BaseException as error:
        draft.unlink(missing_ok=True)
        _remove(made)
        if isinstance(error, OSError) and error.errno in FULL:
            raise _no_room(target, error) from error
        raise
    _sync_folder(target.parent)


def remove_file(path: str | os.PathLike[str]) -> None:
    """Remove a file that an earlier call wrote and this one does not, if it is there."""
    target = Path(path)
    if target.is_file():
        Writing.current().removes(target)
        target.unlink()


def file_to_write(path: str | os.PathLike[str]) -> Path:
    """Return the file that a path leads to, which may not be there.

    Raises
    ------
    InputError
        Where it is a device, a pipe or a socket, what this process has open (/dev/stdout, also
        where that is a file), or cannot be looked at: a link in a circle.
    """
    target = Path(path)
    refuse_special(target, "the name of a file")
    if not target.is_symlink():
        return target
    places = [os.path.realpath(at.parent) for at in (target, target.readlink())]
    if any(place.startswith("/proc/") for place in places):
        raise InputError(f"{path}: is what this process has open; give the name of a file")
    return target.resolve()


def refuse_special(path: str | os.PathLike[str], wanted: str) -> None:
    """Refuse what may never end or never answer, and what cannot be looked at.

    The one is a device, a pipe or a socket; the other a link in a circle, a name that is too long.
    """
    try:
        found = Path(path).stat()
    except (FileNotFoundError, NotADirectoryError):
        return
    except OSError as error:
        raise InputError(
            f"{path}: cannot be looked at ({error.strerror}); give {wanted}"
        ) from error
    except ValueError as error:  # a character that no name has
        raise InputError(f"{path}: is no name of a file ({error}); give {wanted}") from error
    if not stat.S_ISREG(found.st_mode) and not stat.S_ISDIR(found.st_mode):
        raise InputError(f"{path}: is a device, a pipe or a socket; give {wanted}")


def text_of(path: str | os.PathLike[str], wanted: str) -> str:
    """Return the text of a file; `wanted` ends the sentence where there is none to be read.

    Raises
    ------
    InputError
        Where the file cannot be read, or is no text in UTF-8.
    """
    refuse_special(path, wanted)
    try:
        return Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give {wanted}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is no text; give {wanted}") from error


def require_there(path: str | os.PathLike[str]) -> None:
    """Refuse a path of a log at which no file is, nor a folder that is one recording."""
    wanted = "the path of a log"
    refuse_special(path, wanted)
    if not Path(path).is_file() and not (Path(path) / RECORDING).is_file():
        what = "is a folder" if Path(path).is_dir() else "no such file"
        raise InputError(f"{path}: {what}; give {wanted}")


def _draft_file(target: Path, made: list[Path]) -> tuple[int, Path]:
    """An open file beside a file to be; folders that are `made` for it go again if that fails."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
    except OSError as error:
        _remove(made)
        raise InputError(
            f"{target}: cannot be written ({error.strerror}); give a folder that you may write to"
        ) from error
    return handle, Path(name)


def _remove(folders: list[Path]) -> None:
    """Remove folders that were made for what did not come about, the innermost first."""
    for folder in folders:
        with contextlib.suppress(OSError):
            folder.rmdir()


def save_table(frame: pandas.DataFrame, path: str | os.PathLike[str]) -> None:
    """Write a table as CSV, each number with the digits that it takes to read the same again."""
    with atomic_writer(path) as file:
        frame.to_csv(file, index=False, lineterminator="\n")


def save_columns(columns: Mapping[str, NDArray[Any]], path: str | os.PathLike[str]) -> None:
    """Write columns of one length as `save_table` writes a frame of them, without pandas."""
    with atomic_writer(path) as file:
        write_columns(columns, file)


def write_columns(
    columns: Mapping[str, NDArray[Any]], file: BinaryIO, *, head: bool = True
) -> None:
    """Write columns of one length to an open file as CSV, nothing where a number is NaN.

    `head`: their names first; a file that goes on has them already.
    """
    write = csv.writer(lines := io.StringIO(newline=""), lineterminator="\n").writerows
    write([columns] if head else [])
    for first in range(0, max(map(len, columns.values()), default=0), ROWS_AT_ONCE):
        chunk = [data[first : first + ROWS_AT_ONCE].tolist() for data in columns.values()]
        cells = [[None if cell != cell else cell for cell in column] for column in chunk]
        write(zip(*cells, strict=True))
        file.write(lines.getvalue().encode())
        lines.seek(lines.truncate(0))
    file.write(lines.getvalue().encode())


def atomic_write(path: str | os.PathLike[str], content: bytes | str) -> None:
    """Write `content` (text as UTF-8) to `path`, whole or not at all; see `atomic_writer`."""
    with atomic_writer(path) as file:
        file.write(content.encode() if isinstance(content, str) else content)


def _no_room(target: Path, error: OSError) -> InputError:
    return InputError(
        f"{target}: cannot be written ({error.strerror}); make room there, or write elsewhere"
    )


def _rename(draft: Path, target: Path) -> None:
    try:
        draft.replace(target)
    except OSError as error:
        raise InputError(
            f"{target}: cannot be replaced ({error.strerror}); give the name of a file"
        ) from error


def _usual_mode(target: Path) -> int:
    """Return the mode of the file that is replaced, or that of any new file."""
    if target.exists():
        return target.stat().st_mode & 0o777
    return 0o666 & ~_mask()


def _mask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _sync_folder(folder: Path) -> None:
    """Flush the rename itself to the disk, where the system can (Windows cannot)."""
    if os.name == "posix":
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


@contextlib.contextmanager
def whole_folder(path: str | os.PathLike[str], last: str = "") -> Iterator[Path]:
    """Give a draft folder that becomes `path` when the block ends without an error.

    A new folder appears complete. In a folder that exists already each file is replaced as a
    whole, the one named `last` after all others. After an error nothing has changed.

    Raises
    ------
    InputError
        Where `path` is a file, or nothing can be written beside it.
    """
    target = folder_to_write(path)
    made = [folder for folder in target.parents if not folder.exists()]
    draft = _draft_folder(target, made)
    try:
        inside = _WRITING.set(Writing())  # what is drafted replaces nothing
        try:
            yield draft
        finally:
            _WRITING.reset(inside)
        draft.chmod(0o777 & ~_mask())
        _publish(draft, target, last)
    except BaseException as error:
        shutil.rmtree(draft, ignore_errors=True)
        _remove(made)
        if isinstance(error, OSError) and error.errno in FULL:
            raise _no_room(target, error) from error
        if isinstance(error, InputError) and str(draft) in str(error):  # a name that nobody gave
            raise InputError(str(error).replace(str(draft), str(target))) from error
        raise


def folder_to_write(path: str | os.PathLike[str]) -> Path:
    """Return the folder of this path, which may not be there; refuse what is none."""
    target, wanted = Path(path), "the name of a folder"
    refuse_special(target, wanted)
    if target.exists() and not target.is_dir():
        raise InputError(f"{target}: is a file; give {wanted}")
    if target.is_symlink() and not target.exists():
        raise InputError(f"{target}: is a link that leads nowhere; give {wanted}")
    return target


def _beside(file: Path, there: Path) -> Path:
    """The file, or a copy of it where a link leads to another device, which no rename reaches."""
    if file.stat().st_dev == there.parent.stat().st_dev:
        return file
    handle, copy = _draft_file(there, [])
    os.close(handle)
    return Path(shutil.copy(file, copy))


def _draft_folder(target: Path, made: list[Path]) -> Path:
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.is_dir() and not os.access(target, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        return Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    except OSError as error:
        _remove(made)
        raise InputError(
            f"{target}: cannot be written ({error.strerror}); give a folder that you may write to"
        ) from error


def _publish(draft: Path, target: Path, last: str) -> None:
    """Rename the draft, or move its files over those of a folder that is there."""
    record = Writing.current()
    files = sorted(path for path in draft.rglob("*") if path.is_file())
    files.sort(key=lambda file: file.name == last)
    places = [target / file.relative_to(draft) for file in files]
    if not target.exists():
        _rename(draft, target)
        _sync_folder(target.parent)
        record.written += places
        return
    places = [file_to_write(place) for place in places]
    for there in places:
        record.before(there)
    for file, there in zip(files, places, strict=True):
        there.parent.mkdir(parents=True, exist_ok=True)
        record.replaces(file, there)
        _rename(_beside(file, there), there)
    _sync_folder(target)
    shutil.rmtree(draft, ignore_errors=True)
