import pytest

from geomotion.errors import DatasetError, MissingData
from geomotion.xml_files import read_xml

LAUGHS = """<?xml version="1.0"?>
<!DOCTYPE MMM [
<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;">
]>
<MMM>&c;</MMM>
"""
OUTSIDE = '<!DOCTYPE MMM [<!ENTITY x SYSTEM "file:///etc/hostname">]><MMM>&x;</MMM>'


def written(folder, text, name="motion.xml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_elements_attributes_and_text_are_read(tmp_path):
    root = read_xml(written(tmp_path, "<MMM><Motion name='ä &amp; b'>1 <b/>2</Motion></MMM>"))
    assert root[0].get("name") == "ä & b"
    assert (root[0].text, root[0][0].tail) == ("1 ", "2")


@pytest.mark.parametrize("text", [LAUGHS, OUTSIDE, "<!DOCTYPE MMM SYSTEM 'http://example.org/mmm.dtd'><MMM/>"])
def test_document_types_are_refused_before_anything_is_expanded(tmp_path, text):
    with pytest.raises(DatasetError, match="document type"):
        read_xml(written(tmp_path, text))


@pytest.mark.parametrize("text", ["", "<MMM><Motion></MMM>", "<MMM>&unknown;</MMM>", "no XML", "<MMM/><MMM/>"])
def test_what_is_not_well_formed_is_refused(tmp_path, text):
    with pytest.raises(DatasetError, match="not well-formed XML"):
        read_xml(written(tmp_path, text))


def test_missing_files_and_folders_are_named(tmp_path):
    with pytest.raises(MissingData, match="no such file"):
        read_xml(tmp_path / "motion.xml")
    with pytest.raises(MissingData, match="is a folder"):
        read_xml(tmp_path)
