//! Bytes as text: UTF-8 with or without a byte order mark, UTF-16 with one, and what formats and people write besides.

use std::borrow::Cow;

use encoding_rs::{Encoding, UTF_8, WINDOWS_1252};

/// Text that must be UTF-8, or UTF-16 with a byte order mark, which is left out.
///
/// # Errors
/// Line and byte of what is neither.
pub(crate) fn strict(bytes: Cow<'_, [u8]>) -> Result<Cow<'_, str>, String> {
    decoded(bytes, UTF_8)
}

/// Text of which only the ASCII part matters (numbers and keywords of a mesh): what is not UTF-8 is taken for an 8-bit encoding, in
/// which every byte is a letter.
pub(crate) fn lenient(bytes: Cow<'_, [u8]>) -> Cow<'_, str> {
    match plain(bytes) {
        Ok(text) => text,
        Err(bytes) => {
            let (text, _, wrong) = UTF_8.decode(&bytes);
            Cow::Owned(if wrong { WINDOWS_1252.decode(&bytes).0.into_owned() } else { text.into_owned() })
        }
    }
}

/// UTF-8 without a byte order mark, as nearly all text is; the bytes of any other.
fn plain(bytes: Cow<'_, [u8]>) -> Result<Cow<'_, str>, Cow<'_, [u8]>> {
    if Encoding::for_bom(&bytes).is_some() {
        return Err(bytes);
    }
    match bytes {
        Cow::Borrowed(bytes) => {
            std::str::from_utf8(bytes).map(Cow::Borrowed).map_err(|_| Cow::Borrowed(bytes))
        }
        Cow::Owned(bytes) => {
            String::from_utf8(bytes).map(Cow::Owned).map_err(|error| Cow::Owned(error.into_bytes()))
        }
    }
}

/// An XML document in the encoding that it declares.
///
/// # Errors
/// If it declares one that is not known, or is written in another, or is nested so deeply that readers run out of stack.
pub(crate) fn xml(bytes: Cow<'_, [u8]>) -> Result<Cow<'_, str>, String> {
    let declared = declaration(&bytes).unwrap_or("UTF-8");
    let encoding = Encoding::for_label(declared.as_bytes())
        .ok_or_else(|| format!("declares the encoding '{declared}', which is not known; save it as UTF-8"))?;
    // UTF-16 declares itself by its byte order mark; what declares it without one is ASCII, or this would not have been read.
    let encoding = if encoding.is_ascii_compatible() { encoding } else { UTF_8 };
    let text = decoded(bytes, encoding)?;
    if nested_deeper_than(&text, DEEPEST) {
        return Err(format!("has elements nested more than {DEEPEST} deep; it is damaged"));
    }
    Ok(text)
}

/// Elements within elements; robots and scenes have a tenth of it.
const DEEPEST: usize = 256;

fn nested_deeper_than(xml: &str, most: usize) -> bool {
    let (mut rest, mut depth) = (xml, 0usize);
    while let Some(at) = rest.find('<') {
        rest = &rest[at..];
        let skipped = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>")];
        if let Some((_, end)) = skipped.iter().find(|(begin, _)| rest.starts_with(begin)) {
            rest = rest.split_once(end).map_or("", |(_, after)| after);
            continue;
        }
        // A tag ends at a `>` that is in no attribute's value.
        let mut quote = None;
        let end = rest.bytes().position(|byte| match (quote, byte) {
            (None, b'"' | b'\'') => {
                quote = Some(byte);
                false
            }
            (Some(open), _) => {
                if open == byte {
                    quote = None;
                }
                false
            }
            (None, _) => byte == b'>',
        });
        let Some(end) = end else { return false };
        let tag = &rest[..end];
        if tag.starts_with("</") {
            depth = depth.saturating_sub(1);
        } else if !tag.starts_with("<!") && !tag.ends_with('/') {
            depth += 1;
            if depth > most {
                return true;
            }
        }
        rest = &rest[end + 1..];
    }
    false
}

/// A byte order mark goes before `encoding`.
fn decoded<'a>(bytes: Cow<'a, [u8]>, encoding: &'static Encoding) -> Result<Cow<'a, str>, String> {
    let bytes = if encoding == UTF_8 {
        match plain(bytes) {
            Ok(text) => return Ok(text),
            Err(bytes) => bytes,
        }
    } else {
        bytes
    };
    let (text, used, wrong) = encoding.decode(&bytes);
    if !wrong {
        return Ok(Cow::Owned(text.into_owned()));
    }
    let good = std::str::from_utf8(&bytes).err().map_or(0, |error| error.valid_up_to());
    let line = 1 + bytes[..good].iter().filter(|&&byte| byte == b'\n').count();
    Err(format!(
        "is no text in {}: byte 0x{:02x} in line {line}; save it as UTF-8",
        used.name(),
        bytes.get(good).copied().unwrap_or_default()
    ))
}

/// The encoding of `<?xml version="1.0" encoding="..."?>`.
fn declaration(bytes: &[u8]) -> Option<&str> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let end = bytes.windows(2).take(256).position(|pair| pair == b"?>")?;
    let head = std::str::from_utf8(bytes[..end].strip_prefix(b"<?xml")?).ok()?;
    let rest = head.split_once("encoding")?.1.trim_start().strip_prefix('=')?.trim_start();
    let quote = rest.chars().next().filter(|quote| matches!(quote, '"' | '\''))?;
    rest[1..].split(quote).next()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn utf16(text: &str, big: bool) -> Vec<u8> {
        let unit = |unit: u16| if big { unit.to_be_bytes() } else { unit.to_le_bytes() };
        std::iter::once(0xfeff).chain(text.encode_utf16()).flat_map(unit).collect()
    }

    #[test]
    fn a_byte_order_mark_tells_the_encoding_and_is_no_letter() {
        for bytes in
            ["\u{feff}größe = 1".as_bytes().to_vec(), utf16("größe = 1", true), utf16("größe = 1", false)]
        {
            assert_eq!(strict(bytes.clone().into()).unwrap(), "größe = 1");
            assert_eq!(lenient(bytes.into()), "größe = 1");
        }
        assert!(matches!(strict(b"plain".as_slice().into()), Ok(Cow::Borrowed("plain"))));
    }

    #[test]
    fn what_is_no_text_is_an_error_with_its_line_and_letters_of_any_encoding_do_no_harm() {
        let error = strict(b"a = 1\n# f\xfcr\n".as_slice().into()).unwrap_err();
        assert!(error.contains("0xfc in line 2") && error.contains("UTF-8"), "{error}");
        assert_eq!(lenient(b"# f\xfcr\n".as_slice().into()), "# für\n");
        assert_eq!(lenient("# für\n".as_bytes().into()), "# für\n");
    }

    /// A reader that descends by calling itself ends the program at a hundred thousand elements in each other.
    #[test]
    fn xml_that_is_nested_too_deeply_is_refused_and_what_only_looks_so_is_not() {
        let nested = |n: usize| format!("<r>{}{}</r>", "<a>".repeat(n), "</a>".repeat(n));
        assert!(xml(nested(100_000).into_bytes().into()).unwrap_err().contains("256 deep"));
        assert!(
            xml(nested(DEEPEST).into_bytes().into()).is_err()
                && xml(nested(DEEPEST - 1).into_bytes().into()).is_ok()
        );
        let flat = "<!-- <a> --><a b='>' c=\"/>'>\"/><![CDATA[<a>]]><a></a><?a <a>?>".repeat(1000);
        assert!(xml(format!("<r>{flat}</r>").into_bytes().into()).is_ok());
        // Tags that never end are told by who parses.
        assert!(xml("<a ".repeat(1000).into_bytes().into()).is_ok());
    }

    #[test]
    fn xml_is_read_in_the_encoding_that_it_declares() {
        let latin = b"<?xml version=\"1.0\" encoding='ISO-8859-1' ?><a n=\"gr\xfcn\"/>";
        assert!(xml(latin.as_slice().into()).unwrap().contains("grün"));
        let shift = b"<?xml version='1.0' encoding=\"Shift_JIS\"?><a n=\"\x98\x72\"/>";
        assert!(xml(shift.as_slice().into()).unwrap().contains('腕'));
        let wide = utf16("<?xml version=\"1.0\" encoding=\"UTF-16\"?><a n=\"腕\"/>", false);
        assert!(xml(wide.into()).unwrap().contains('腕'));
        assert!(xml(b"<a n='gr\xfcn'/>".as_slice().into()).unwrap_err().contains("UTF-8"));
        let error = xml(b"<?xml version='1.0' encoding='klingon'?><a/>".as_slice().into()).unwrap_err();
        assert!(error.contains("'klingon'"), "{error}");
        // Declared wide, written narrow: as every other reader takes it.
        assert_eq!(xml(b"<?xml version='1.0' encoding='utf-16'?><a/>".as_slice().into()).unwrap().len(), 43);
    }
}
