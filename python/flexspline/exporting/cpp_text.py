"""All text that an export writes into C++: names, numbers, strings, includes and comments.

A model file is data that somebody else wrote. Whatever its texts hold, an exported header has the
declarations that its writers put there and no others: what becomes a name is refused unless it is
one, what becomes a string is escaped, and what becomes a comment stays within its line. A namespace
that would clash with C++ or the C library gets the ending `_model`.

The stages of a chain become constants with their units; stages, and the numbers that they are set
up with, are those that the core lists.
"""

from __future__ import annotations

import re
import textwrap
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

from flexspline import _core
from flexspline.errors import InputError, shortened

__all__ = [
    "IN_ASCII",
    "OF_THE_C_LIBRARY",
    "STAGES",
    "WORDS",
    "Field",
    "Stage",
    "comment",
    "gear_text",
    "given",
    "identifier",
    "in_ascii",
    "include",
    "literal",
    "namespace_name",
    "number",
    "stage_lines",
    "stages_in",
    "string_literal",
    "whole",
]


LARGEST_RATIO = 2**30
LARGEST = float.fromhex("0x1.fffffep+127")  # the largest float
LONGEST = 64  # characters of a name
IDENTIFIER = re.compile(r"(?!.*__)[A-Za-z][A-Za-z0-9_]*")
HEADER = re.compile(r"(?!.*\.\.)[A-Za-z0-9_][A-Za-z0-9_.-]*(/[A-Za-z0-9_][A-Za-z0-9_.-]*)*")
SIGNS = "±°·×−–²³⁰¹⁴⁵⁶⁷⁸⁹⁻"  # of numbers and units, which headers hold beside ASCII
SPELLED = {
    "\u00b5": "u", "\u03bc": "u", "\u03a9": "Ohm", "\u2126": "Ohm",
    "\N{RIGHTWARDS ARROW}": "->", "\N{LESS-THAN OR EQUAL TO}": "<=",
    "\N{GREATER-THAN OR EQUAL TO}": ">=", "\N{ALMOST EQUAL TO}": "~",
}  # fmt: skip
IN_ASCII = str.maketrans(
    {"±": "+-", "°": "deg ", "·": " ", "×": "x", "−": "-", "–": "-"}
    | {sign: f"^{digit}" for sign, digit in zip("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789", strict=True)}
    | {"⁻": "-"}
)
GREEK = re.compile(r"GREEK (SMALL|CAPITAL) LETTER (\w+)")  # of formulas: "theta"
PLAIN = re.compile(r"[ !#->@-\[\]-~]")  # of ASCII, without quote, question mark and backslash

# Keywords of C++20, and the namespaces that an exported header needs.
_WORDS = """
alignas alignof and and_eq asm auto bitand bitor bool break case catch char char16_t char32_t
char8_t class co_await co_return co_yield compl concept const const_cast consteval constexpr
constinit continue decltype default delete do double dynamic_cast else enum explicit export extern
false float for friend goto if inline int long main mutable namespace new noexcept not not_eq
nullptr operator or or_eq private protected public register reinterpret_cast requires return short
signed sizeof static static_assert static_cast std struct switch template this thread_local throw
true try typedef typeid typename union unsigned using virtual void volatile wchar_t while xor
xor_eq flexspline
"""
WORDS = frozenset(_WORDS.split())

# Global names of the C library: functions, types and macros of one lower-case word that g++ finds
# to clash with a namespace behind the headers of C and those that libstdc++ includes on Linux.
# Those of another precision, such as gammaf, are told by their ending.
_C_LIBRARY = """
a64l abort abs access acct acos acosh alarm alloca arc4random asctime asin asinh asprintf assert
atan atan2 atanh atexit atof atoi atol basename bcmp bcopy be16toh be32toh be64toh brk bsearch
btowc bzero c16rtomb c32rtomb c8rtomb cabs cacos cacosh calloc canonicalize carg casin casinh
catan catanh cbrt ccos ccosh ceil cexp chdir chown chroot cimag clearenv clearerr clock clog
clog10 clone close closefrom confstr conj copysign cos cosh cpow cproj creal crypt csin csinh
csqrt ctan ctanh ctermid ctime cuserid daddl daemon daylight ddivl dfmal difftime div dmull
dprintf drand48 drem dsqrtl dsubl dup dup2 dup3 duplocale dysize eaccess ecvt endusershell environ
erand48 erf erfc errno euidaccess execl execle execlp execv execve execveat execvp execvpe exit
exp exp10 exp2 expm1 fabs faccessat fadd fchdir fchown fchownat fclose fcloseall fcvt fdatasync
fdim fdiv fdopen feclearexcept fedisableexcept feenableexcept fegetenv fegetexcept fegetexceptflag
fegetmode fegetround feholdexcept feof feraiseexcept ferror fesetenv fesetexcept fesetexceptflag
fesetmode fesetround fetestexcept fetestexceptflag feupdateenv fexecve fflush ffma ffs fgetc
fgetpos fgetpos64 fgets fgetwc fgetws fileno finite flockfile floor fma fmax fmaximum fmaxmag
fmemopen fmin fminimum fminmag fmod fmul fopen fopen64 fopencookie fork fpathconf fpclassify
fprintf fputc fputs fputwc fputws fread free freelocale freopen freopen64 frexp fromfp fromfpx
fscanf fseek fseeko fseeko64 fsetpos fsetpos64 fsqrt fsub fsync ftell ftello ftello64 ftruncate
ftruncate64 ftrylockfile funlockfile fwide fwprintf fwrite fwscanf gamma gcvt getc getchar getcpu
getcwd getdate getdelim getdomainname getdtablesize getegid getentropy getenv geteuid getgid
getgroups gethostid gethostname getline getloadavg getlogin getopt getpagesize getpass getpayload
getpgid getpgrp getpid getppid getpt getresgid getresuid getsid getsubopt gettid getuid
getusershell getw getwc getwchar getwd gmtime grantpt gsignal htobe16 htobe32 htobe64 htole16
htole32 htole64 hypot ilogb imaxabs imaxdiv index initstate isalnum isalpha isascii isatty isblank
iscanonical iscntrl isctype isdigit iseqsig isfinite isgraph isgreater isgreaterequal isinf isless
islessequal islessgreater islower isnan isnormal isprint ispunct issignaling isspace issubnormal
isunordered isupper iswalnum iswalpha iswblank iswcntrl iswctype iswdigit iswgraph iswlower
iswprint iswpunct iswspace iswupper iswxdigit isxdigit iszero itimerspec j0 j1 jn jrand48 kill
killpg l64a labs lchown lcong48 lconv ldexp ldiv le16toh le32toh le64toh lerp lgamma link linkat
linux llabs lldiv llogb llrint llround localeconv localtime lockf lockf64 log log10 log1p log2
logb longjmp lrand48 lrint lround lseek lseek64 malloc mblen mbrlen mbrtoc16 mbrtoc32 mbrtoc8
mbrtowc mbsinit mbsnrtowcs mbsrtowcs mbstowcs mbtowc memccpy memchr memcmp memcpy memfrob memmem
memmove mempcpy memrchr memset mkdtemp mkostemp mkostemp64 mkostemps mkostemps64 mkstemp mkstemp64
mkstemps mkstemps64 mktemp mktime modf mrand48 nan nanosleep nearbyint newlocale nextafter
nextdown nexttoward nextup nice nrand48 obstack offsetof optarg opterr optind optopt pathconf
pause pclose perror pipe pipe2 popen pow pread pread64 printf profil pselect psiginfo psignal
ptsname putc putchar putenv puts putw putwc putwchar pwrite pwrite64 qecvt qfcvt qgcvt qsort raise
rand random rawmemchr read readlink readlinkat realloc reallocarray realpath remainder remove
remquo rename renameat renameat2 revoke rewind rindex rint rmdir round roundeven rpmatch sbrk
scalb scalbln scalbn scanf seed48 select setbuf setbuffer setdomainname setegid setenv seteuid
setgid sethostid sethostname setjmp setlinebuf setlocale setlogin setns setpayload setpayloadsig
setpgid setpgrp setregid setresgid setresuid setreuid setsid setstate setuid setusershell setvbuf
sigaction sigaddset sigaltstack sigandset sigblock sigcontext sigdelset sigemptyset sigevent
sigfillset siggetmask sighold sigignore siginterrupt sigisemptyset sigismember siglongjmp sigmask
signal signbit signgam significand sigorset sigpause sigpending sigprocmask sigqueue sigrelse
sigreturn sigset sigsetjmp sigsetmask sigstack sigsuspend sigtimedwait sigval sigwait sigwaitinfo
sin sincos sinh sleep snprintf sprintf sqrt srand srand48 srandom sscanf ssignal stderr stdin
stdout stpcpy stpncpy strcasecmp strcasestr strcat strchr strchrnul strcmp strcoll strcpy strcspn
strdup strdupa strerror strfromd strfromf strfromf128 strfromf32 strfromf32x strfromf64
strfromf64x strfroml strfry strftime strlen strncasecmp strncat strncmp strncpy strndup strndupa
strnlen strpbrk strptime strrchr strsep strsignal strspn strstr strtod strtof strtof128 strtof32
strtof32x strtof64 strtof64x strtoimax strtok strtol strtold strtoq strtoul strtoumax strtouq
strverscmp strxfrm swab swprintf swscanf symlink symlinkat sync syncfs syscall sysconf system tan
tanh tcgetpgrp tcsetpgrp tempnam tgamma tgkill time timegm timelocal timespec timeval timex
timezone tm tmpfile tmpfile64 tmpnam toascii tolower totalorder totalordermag toupper towctrans
towlower towupper trunc truncate truncate64 ttyname ttyslot tzname tzset ualarm ufromfp ufromfpx
uint ulong ungetc ungetwc unix unlink unlinkat unlockpt unsetenv unshare uselocale ushort usleep
valloc vasprintf vdprintf vfork vfprintf vfscanf vfwprintf vfwscanf vhangup vprintf vscanf
vsnprintf vsprintf vsscanf vswprintf vswscanf vwprintf vwscanf wcpcpy wcpncpy wcrtomb wcscasecmp
wcscat wcschr wcschrnul wcscmp wcscoll wcscpy wcscspn wcsdup wcsftime wcslen wcsncasecmp wcsncat
wcsncmp wcsncpy wcsnlen wcsnrtombs wcspbrk wcsrchr wcsrtombs wcsspn wcsstr wcstod wcstof wcstof128
wcstof32 wcstof32x wcstof64 wcstof64x wcstoimax wcstok wcstol wcstold wcstombs wcstoq wcstoul
wcstoumax wcstouq wcswcs wcswidth wcsxfrm wctob wctomb wctrans wctype wcwidth wmemchr wmemcmp
wmemcpy wmemmove wmempcpy wmemset wprintf write wscanf y0 y1 yn
"""
OF_THE_C_LIBRARY = frozenset(_C_LIBRARY.split())

# Macros that g++ knows behind the headers of the C and the C++ library on Linux, in families that
# begin or end alike, and by themselves. A macro takes the place of a namespace's name.
_FAMILIES = re.compile(
    r"(ATOMIC|ADJ|BUS|CLD|CLOCK|CLONE|CLOSE_RANGE|CPU|DBL|FD|FE|FLT|FP|FPE|HUGE_VAL|ILL|ITIMER|LC|"
    r"LDBL|M|MATH|MOD|NL|POLL|PTHREAD|REG|RENAME|SA|SCHED|SEEK|SEGV|SI|SS|STA|STD(IN|OUT|ERR)|SYS|"
    r"TIMER|TIMESPEC|TIMEVAL|TRAP)_\w+|(si|sa|sigev|pthread)_[a-z]\w*|U?INT\w*_(MAX|MIN|C|WIDTH)|"
    r"(PRI|SCN)[a-zX]\w*|SIG_?[A-Z0-9]+|\w+_(MAX|MIN|WIDTH|BIT)"
)
_MACRO_WORDS = """
BIG_ENDIAN BUFSIZ BYTE_ORDER CLOCKS_PER_SEC CSIGNAL DECIMAL_DIG E2BIG EACCES EADDRINUSE
EADDRNOTAVAIL EADV EAFNOSUPPORT EAGAIN EALREADY EBADE EBADF EBADFD EBADMSG EBADR EBADRQC EBADSLT
EBFONT EBUSY ECANCELED ECHILD ECHRNG ECOMM ECONNABORTED ECONNREFUSED ECONNRESET EDEADLK EDEADLOCK
EDESTADDRREQ EDOM EDOTDOT EDQUOT EEXIST EFAULT EFBIG EHOSTDOWN EHOSTUNREACH EHWPOISON EIDRM EILSEQ
EINPROGRESS EINTR EINVAL EIO EISCONN EISDIR EISNAM EKEYEXPIRED EKEYREJECTED EKEYREVOKED EL2HLT
EL2NSYNC EL3HLT EL3RST ELIBACC ELIBBAD ELIBEXEC ELIBMAX ELIBSCN ELNRNG ELOOP EMEDIUMTYPE EMFILE
EMLINK EMSGSIZE EMULTIHOP ENAMETOOLONG ENAVAIL ENETDOWN ENETRESET ENETUNREACH ENFILE ENOANO ENOBUFS
ENOCSI ENODATA ENODEV ENOENT ENOEXEC ENOKEY ENOLCK ENOLINK ENOMEDIUM ENOMEM ENOMSG ENONET ENOPKG
ENOPROTOOPT ENOSPC ENOSR ENOSTR ENOSYS ENOTBLK ENOTCONN ENOTDIR ENOTEMPTY ENOTNAM ENOTRECOVERABLE
ENOTSOCK ENOTSUP ENOTTY ENOTUNIQ ENXIO EOF EOPNOTSUPP EOVERFLOW EOWNERDEAD EPERM EPFNOSUPPORT EPIPE
EPROTO EPROTONOSUPPORT EPROTOTYPE ERANGE EREMCHG EREMOTE EREMOTEIO ERESTART ERFKILL EROFS ESHUTDOWN
ESOCKTNOSUPPORT ESPIPE ESRCH ESRMNT ESTALE ESTRPIPE ETIME ETIMEDOUT ETOOMANYREFS ETXTBSY EUCLEAN
EUNATCH EUSERS EWOULDBLOCK EXDEV EXFULL EXIT_FAILURE EXIT_SUCCESS F_LOCK F_OK F_TEST F_TLOCK F_ULOCK
HUGE_VAL HUGE_VALF HUGE_VALL INFINITY LITTLE_ENDIAN L_INCR L_SET L_XTND L_ctermid L_cuserid L_tmpnam
MAXFLOAT MAX_CANON MAX_INPUT MINSIGSTKSZ NAN NFDBITS NGREG NSIG NULL NZERO PDP_ENDIAN PIPE_BUF
P_tmpdir R_OK SEM_FAILED SIGEV_NONE SIGEV_SIGNAL SIGEV_THREAD SIGEV_THREAD_ID SNAN SNANF SNANF128
SNANF32 SNANF32X SNANF64 SNANF64X SNANL TEMP_FAILURE_RETRY TIME_UTC WCONTINUED WEOF WEXITED
WEXITSTATUS WIFCONTINUED WIFEXITED WIFSIGNALED WIFSTOPPED WNOHANG WNOWAIT WSTOPPED WSTOPSIG WTERMSIG
WUNTRACED W_OK X_OK assert_perror math_errhandling sched_priority timeradd timerclear timercmp
timerisset timersub va_arg va_copy va_end va_start
"""
_MACROS = frozenset(_MACRO_WORDS.split())
_PRECISION = re.compile(r"(f|l|f32|f32x|f64|f64x|f128)$")
_RESERVED = re.compile(r".*_t|posix|std[0-9]+")

Entry = Mapping[str, Any]

SMALLEST = float.fromhex("0x1p-126")  # the smallest float with all its digits
INDENT = "\n" + " " * 6
END = "\n" + " " * 2


def identifier(text: str) -> str:
    """Return a name that C++ can declare, or refuse the text.

    Raises
    ------
    InputError
        Where the text has anything but ASCII letters, digits and single underscores, is longer than
        64 characters, or is a word of C++.
    """
    if len(text) > LONGEST or not IDENTIFIER.fullmatch(text) or text in WORDS:
        raise InputError(
            f"{shortened(ascii(text), 80)} is no name that C++ can hold; give letters, digits and "
            "single underscores, and no word of C++"
        )
    return text


def namespace_name(stem: str) -> str:
    """Return a namespace for the stem of a file: "joint 7" is "joint_7", "gamma" "gamma_model"."""
    name = re.sub(r"[^A-Za-z0-9]+", "_", stem)[: LONGEST - len("joint__model")].strip("_")
    name = name or "model"
    if name[0].isdigit():
        name = f"joint_{name}"
    return identifier(f"{name}_model" if is_taken(name) else name)


def string_literal(text: str) -> str:
    """Return a narrow string literal of the text in UTF-8."""
    return '"' + "".join(map(_escaped, text)) + '"'


def include(name: str | PurePath) -> str:
    """Return the line that includes a header.

    Raises
    ------
    InputError
        Where its name has anything but letters, digits and ``_ - . /``.
    """
    if not HEADER.fullmatch(str(name)):
        raise InputError(f"{shortened(ascii(str(name)), 80)} is no name of a header")
    return f'#include "{name}"'


def comment(text: str) -> str:
    """Return the text in a form that stays inside a comment and its line.

    Control characters, line and paragraph separators, and marks that turn the direction of writing
    become blanks, letters beyond ASCII lose their accents, are spelled (Greek ones) or become
    question marks, but for the signs of numbers and units; a backslash, which would join the next
    line, becomes a slash; the marks of a trigraph and of a block comment are parted.
    """
    text = "".join(map(_plain, text)).replace("\\", "/")
    return re.sub(r"\?(?=\?)|\*(?=/)|/(?=\*)", r"\g<0> ", text)


def in_ascii(text: str) -> str:
    """Return the text as a comment has it, the signs of numbers and units spelled too."""
    return comment(text).translate(IN_ASCII)


def _plain(letter: str) -> str:
    if letter.isascii() or letter in SIGNS:
        return letter if letter.isprintable() else " "
    if not letter.isprintable():
        return " "
    plain = SPELLED.get(letter) or unicodedata.normalize("NFKD", letter).replace(
        "\N{FRACTION SLASH}", "/"
    )
    if greek := GREEK.fullmatch(unicodedata.name(plain[0], "")):
        plain = greek[2].lower() if greek[1] == "SMALL" else greek[2].capitalize()
    return "".join(each for each in plain if each.isascii() and each.isprintable()) or "?"


def literal(value: float, name: str) -> str:
    """The shortest decimal that reads back as the same double, as a number of type S.

    Raises
    ------
    InputError
        Where no float holds it; `name` is what the sentence calls it.
    """
    if not abs(value) <= LARGEST:
        raise InputError(f"{name} = {value} does not fit into a float; fit the model again")
    return f"S({number(value, name)})"


def number(value: float, name: str) -> str:
    """The shortest decimal of a finite number that reads back as the same double."""
    made = float(value)
    if not abs(made) < float("inf"):
        raise InputError(f"{name} = {made} is not finite; give a number")
    return repr(made)


def whole(value: int) -> str:
    """A whole number."""
    return str(int(value))


def boolean(value: bool) -> str:
    """True or false."""
    return "true" if value else "false"


def gear_text(gear: Mapping[str, Any]) -> str:
    """A gear of `gear_of` as C++."""
    ratio = gear["effective_ratio"]
    if not 0 < ratio <= LARGEST_RATIO:
        raise InputError(f"gear_ratio gives an effective ratio of {ratio}; give one in 0 to 2^30")
    return (
        f"flexspline::Gear<S>::from_ratio({number(ratio, 'effective_ratio')}, "
        f"flexspline::OutputSpline::{identifier(gear['output_spline'])},\n"
        f"                                    "
        f"/*motor_encoder=*/{boolean(gear['motor_encoder'])})"
    )


def _escaped(letter: str) -> str:
    if PLAIN.fullmatch(letter):
        return letter
    return "".join(f"\\{byte:03o}" for byte in letter.encode(errors="replace"))


def is_taken(name: str) -> bool:
    """Whether a namespace of this name would clash with the language, its library or a macro."""
    return (
        name in WORDS
        or name in OF_THE_C_LIBRARY
        or name in _MACROS
        or _FAMILIES.fullmatch(name) is not None
        or _PRECISION.sub("", name) in OF_THE_C_LIBRARY
        or _RESERVED.fullmatch(name) is not None
    )


@dataclass(frozen=True)
class Field:
    """A number of a stage, or a list of them (`flexspline/fields.hpp`).

    Parameters
    ----------
    name : of the member in the core.
    unit : in words.
    key : in `model.json`; two fields of one key are the two numbers of its list.
    place : 0 or 1 in that list; None where the key is the field's own.
    default : what it is where nothing is given; None for a list.
    """

    name: str
    unit: str
    key: str
    place: int | None
    default: float | None


@dataclass(frozen=True)
class Choice:
    """What a chain chooses between its stages, by a word under `key` in an entry.

    `member` of the chain and `type` of its values in C++, `prefix` of the word in a block.
    """

    key: str
    member: str
    type: str
    prefix: str


@dataclass(frozen=True)
class Stage:
    """A stage of the core's chain (`flexspline/estimators/stages.hpp`).

    Parameters
    ----------
    key : of the stage.
    within : of the entry in `model.json` that holds its numbers.
    member, type : of the chain in C++; the type says {key} for the length of that list.
    rules : key in the entry and C++ type of each rule that a program is compiled for.
    fields : its numbers, in the core's order.
    choice : what the chain chooses by its entry, or None.
    """

    key: str
    within: str
    member: str
    type: str
    rules: tuple[tuple[str, str], ...]
    fields: tuple[Field, ...]
    choice: Choice | None


def _fields(known: list[dict[str, Any]]) -> tuple[Field, ...]:
    keys = [one["key"] for one in known]
    return tuple(
        Field(
            one["name"],
            one["unit"],
            one["key"],
            keys[:number].count(one["key"]) if keys.count(one["key"]) == 2 else None,
            one.get("default"),
        )
        for number, one in enumerate(known)
    )


STAGES: Mapping[str, Stage] = {
    key: Stage(
        key,
        one["within"],
        one["member"],
        one["type"],
        tuple((rule["name"], rule["type"]) for rule in one["rules"]),
        _fields(one["fields"]),
        Choice(**one["choice"]) if one["choice"] else None,
    )
    for key, one in _core.stages().items()
}
"""By key, in the order of a chain's parameters."""


def stages_in(entries: Mapping[str, Entry]) -> Iterator[tuple[Stage, Entry | None]]:
    """Yield each stage whose entry is there, with what holds its numbers: None where it is not run.

    A loop is an entry of its own inside the compliance's; a merge runs by one of its two methods.
    """
    for stage in STAGES.values():
        entry = entries.get(stage.within)
        if entry is not None and stage.key != stage.within:
            runs = stage.key == entry.get("method", "logistic")
            entry = entry.get(stage.key, entry if runs else None)
        if stage.within in entries:
            yield stage, entry


def given(stage: Stage, entry: Entry) -> Iterator[tuple[Field, Any]]:
    """Yield each field of a stage with its value in an entry of `model.json`, None for no value."""
    for field in stage.fields:
        value = entry.get(field.key)
        yield field, value if value is None or field.place is None else value[field.place]


def stage_lines(name: str, entries: Mapping[str, Entry], has_sensor: bool) -> Iterator[str]:
    """A struct of these stages as its fields; all others are absent and cost nothing."""
    yield "template <typename S>"
    yield f"struct {name} : flexspline::NoStages<S> {{"
    if has_sensor:
        yield "  static constexpr bool sensor = true;"
    for stage, entry in stages_in(entries):
        if entry is not None:
            yield _stage(stage, entry)
        if stage.choice is not None:
            yield _chosen(stage.choice, entries[stage.within])
    yield "};"


def _stage(stage: Stage, entry: Entry) -> str:
    """A field of a C++ type, a number on a line, then its rules."""
    lines = _numbers(stage, entry)
    if stage.key == "kalman":  # holds the logistic merge, for the weight of its motion
        motion = "".join(f"{INDENT}    {line}" for line in _numbers(STAGES["logistic"], entry))
        lines.insert(0, f".motion = {{{motion}{INDENT}}},")
    if "gear" in entry:
        lines.append(f".gear = {gear_text(entry['gear'])},")
    lines += [
        f".{rule} = flexspline::{made}::{identifier(entry[rule])}," for rule, made in stage.rules
    ]
    counts = {key: len(value) for key, value in entry.items() if isinstance(value, list)}
    made = stage.type.format(**counts)
    return f"  {made} {stage.member}{{{''.join(INDENT + line for line in lines)}{END}}};"


def _chosen(choice: Choice, entry: Entry) -> str:
    word = identifier(entry[choice.key])
    return f"  static constexpr auto {choice.member} = flexspline::{choice.type}::{word};"


def _numbers(stage: Stage, entry: Entry) -> list[str]:
    """The numbers of a stage that its entry gives, in the core's order."""
    return [
        _field(stage.within, field, value)
        for field, value in given(stage, entry)
        if value is not None and value != []
    ]


def _field(key: str, field: Field, value: float | Sequence[float]) -> str:
    unit = f"  // {comment(field.unit)}" if field.unit else ""
    if isinstance(value, Sequence):
        text = ", ".join(_number(key, field.name, one) for one in value)
        lines = textwrap.wrap(text, 48, break_long_words=False)
        return f".{field.name} = {{{{{(INDENT + '    ').join(lines)}}}}},{unit}"
    return f".{field.name} = {_number(key, field.name, value)},{unit}"


def _number(key: str, name: str, value: float) -> str:
    """A literal; a value that a float cannot hold is refused by its name."""
    if value != 0.0 and abs(value) < SMALLEST:
        raise InputError(
            f"the estimator {key} cannot run on a device: {name} = {value:g} vanishes in a "
            "float; fit it again"
        )
    return literal(value, f"the estimator {key} cannot run on a device: {name}")
