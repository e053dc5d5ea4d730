//! Reading a description that anybody may have written, in time linear in its length.

use quick_xml::escape::unescape;
use quick_xml::events::Event;

/// The guid at the root of a description: the first element's, whatever follows it.
pub(crate) fn guid(description: &str) -> Result<Option<String>, String> {
    let mut reader = quick_xml::Reader::from_str(description);
    loop {
        match reader.read_event().map_err(|error| error.to_string())? {
            Event::Start(root) | Event::Empty(root) => {
                // Without the check for attributes that stand twice, which takes the square of their number.
                let mut attributes = root.attributes();
                let mut attributes = attributes.with_checks(false).flatten();
                let guid = attributes.find(|attribute| attribute.key.as_ref() == "guid");
                return Ok(guid
                    .map(|attribute| unescape(&attribute.value).unwrap_or_default().into_owned()));
            }
            Event::Eof => return Err("there is no element in it".into()),
            _ => {}
        }
    }
}
