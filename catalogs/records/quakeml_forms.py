"""QuakeML as other programs write it, brought into the form that ObsPy reads without leaving events out.

ObsPy ignores an event whose type is no word of the standard ("blast"), forgets a status in capitals, and finds nothing
in a file whose elements have a prefix or the namespace of another version.
"""

from dataclasses import dataclass
from pathlib import Path

from lxml import etree
from obspy.core.event.header import EventType

from catalogs.records.csv_table import check_container
from catalogs.records.event_kinds import MODE, STATUS, plain_word
from catalogs.records.times import check_offset
from catalogs.sources.quakeml import NAMESPACE
from common.errors import InputError

NAMESPACE_START = "http://quakeml.org/xmlns/"  # with which namespaces of all versions of QuakeML begin
ROOT, BODY = f"{NAMESPACE_START}quakeml/1.2", f"{NAMESPACE_START}bed/1.2"
TIME = "time"
STATUS_TAGS = {"evaluationStatus": STATUS, "evaluationMode": MODE}


@dataclass(frozen=True)
class Words:
    """Texts of one event: its publicID; in lower case its type, and of each origin its status, mode and time."""

    name: str
    event_type: str
    origins: tuple[dict[str, str], ...]


def plain_quakeml(content: bytes, path: Path) -> tuple[bytes, list[Words]]:
    """QuakeML 1.2 that ObsPy reads whole, and the words of each event, in order. Raises InputError for what is none."""
    check_container(content, path, "QuakeML")
    try:
        root = etree.fromstring(content, etree.XMLParser(resolve_entities=False, no_network=True))
    except etree.XMLSyntaxError as error:
        text = content.lstrip(b"\xef\xbb\xbf \r\n")[:200]
        hint = "" if text.startswith(b"<") else "; a table, as FDSN's text is, is read by record.reader: csv"
        raise InputError(f"{path}: not QuakeML 1.2 ({str(error)[:200]}){hint}") from error
    if etree.QName(root).localname != "quakeml":
        raise InputError(f"{path}: not QuakeML 1.2, but <{etree.QName(root).localname}>; export it as QuakeML 1.2")
    others = {prefix: name for prefix, name in root.nsmap.items() if prefix and not name.startswith(NAMESPACE_START)}
    plain = etree.Element(f"{{{ROOT}}}quakeml", nsmap={**others, None: BODY, "q": ROOT})
    _copy_parts(root, plain)
    catalogs = plain.findall(f"{{{BODY}}}eventParameters")
    if len(catalogs) > 1 and any(etree.QName(part).namespace == NAMESPACE for one in catalogs for part in one):
        raise InputError(
            f"{path}: joins catalogues that this project wrote, each in a frame of its own: give one of them"
        )
    for other in catalogs[1:]:  # of files that were joined; ObsPy reads the first alone
        catalogs[0].extend(other.findall(f"{{{BODY}}}event"))
        plain.remove(other)
    words: list[Words] = []
    for event in plain.iterfind(f"{{{BODY}}}eventParameters/{{{BODY}}}event"):
        kind = event.find(f"{{{BODY}}}type")
        word = _plain(kind)
        if kind is not None:
            kind.text = word if word in EventType.keys() else None
        for time in event.iterfind(f"{{{BODY}}}origin/{{{BODY}}}time/{{{BODY}}}value"):
            check_offset((time.text or "").strip(), f"{path}: event {len(words) + 1}")
        origins = event.iterfind(f"{{{BODY}}}origin")
        words.append(Words(event.get("publicID", ""), word, tuple(_statuses(origin) for origin in origins)))
        for part in event.iter(*(f"{{{BODY}}}{tag}" for tag in STATUS_TAGS)):
            part.text = _plain(part)
    return etree.tostring(plain), words


def _copy_parts(element: etree._Element, copy: etree._Element) -> None:
    """Copy what an element holds; what is of any version of QuakeML becomes that of 1.2, other namespaces stay."""
    for part in element.iterchildren(etree.Element):
        name = etree.QName(part)
        own = name.namespace is None or name.namespace.startswith(NAMESPACE_START)
        made = etree.SubElement(copy, f"{{{BODY}}}{name.localname}" if own else part.tag, part.attrib)
        made.text = part.text
        _copy_parts(part, made)


def _statuses(origin: etree._Element) -> dict[str, str]:
    time = origin.find(f"{{{BODY}}}time/{{{BODY}}}value")
    found = {kind: _plain(origin.find(f"{{{BODY}}}{tag}")) for tag, kind in STATUS_TAGS.items()}
    return found | {TIME: ((time.text or "") if time is not None else "").strip()}


def _plain(element: etree._Element | None) -> str:
    return plain_word((element.text or "") if element is not None else "")
