"""XML files that others wrote, read without anything that a document type may ask of a parser."""

from pathlib import Path
from xml.etree.ElementTree import Element, ParseError, TreeBuilder
from xml.parsers import expat

from geomotion.errors import DatasetError, MissingData


def read_xml(path: Path) -> Element:
    """The root element of a file.

    Documents with a document type are refused: only these can declare entities, which expand without bound, or name
    other files. What expat builds in (``&lt;`` and the like) is left.

    Raises:
        MissingData: If there is no such file.
        DatasetError: If it cannot be read, is not well-formed XML, or has a document type; names the line.
    """
    if not path.is_file():
        what = "It is a folder" if path.is_dir() else "There is no such file"
        raise MissingData(f"file {path}", f"{what}; name the XML file itself.")
    builder = TreeBuilder()
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data

    def refuse(*_: object) -> None:
        raise DatasetError(path, f"line {parser.CurrentLineNumber}: declares a document type; expected plain XML")

    parser.StartDoctypeDeclHandler = refuse
    try:
        with path.open("rb") as file:
            parser.ParseFile(file)
        return builder.close()
    except (expat.ExpatError, ParseError, UnicodeError, ValueError) as error:
        raise DatasetError(path, f"not well-formed XML ({error})") from error
    except OSError as error:
        raise DatasetError(path, f"cannot be read ({error.strerror})") from error
