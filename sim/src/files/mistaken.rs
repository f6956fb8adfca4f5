//! What people give in place of a file without knowing it: a pointer to it, an archive with it inside, a page about it, nothing.

/// What the bytes are, and what to do, when they are none of what this project reads.
pub(super) fn instead(bytes: &[u8]) -> Option<&'static str> {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    let begins = |with: &[u8]| text.get(..with.len()).is_some_and(|head| head.eq_ignore_ascii_case(with));
    Some(if text.is_empty() {
        "is empty; copy, unpack or write it again"
    } else if begins(b"version https://git-lfs.github.com/spec/") {
        "is a Git LFS pointer and not the file itself; fetch it with `git lfs pull` in its repository"
    } else if begins(b"<!doctype html") || begins(b"<html") {
        "is an HTML page and not the file itself; download the raw file"
    } else if bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"PK\x05\x06") {
        "is a zip archive; unpack it first"
    } else if bytes.starts_with(b"\x1f\x8b") {
        "is a gzip archive; unpack it first"
    } else if bytes.starts_with(b"7z\xbc\xaf\x27\x1c") || bytes.starts_with(b"\xfd7zXZ\0") {
        "is a 7z or xz archive; unpack it first"
    } else if bytes.get(257..262) == Some(b"ustar") {
        "is a tar archive; unpack it first"
    } else {
        return None;
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_in_place_of_a_file_is_recognised() {
        let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a2146\nsize 12345\n";
        for (bytes, wanted) in [
            (&b""[..], "is empty"),
            (b" \r\n\t", "is empty"),
            (b"\xef\xbb\xbf", "is empty"),
            (pointer.as_bytes(), "git lfs pull"),
            (b"\n<!DOCTYPE HTML><html>", "HTML page"),
            (b"\xef\xbb\xbf<HTML lang='en'>", "HTML page"),
            (b"PK\x03\x04\x14\0", "zip archive"),
            (b"\x1f\x8b\x08\0", "gzip"),
            (&[&[0; 257][..], b"ustar\0"].concat(), "tar archive"),
        ] {
            assert!(instead(bytes).unwrap_or("").contains(wanted), "{wanted}");
        }
    }

    #[test]
    fn what_is_read_is_not_mistaken() {
        let files: [&[u8]; 8] = [
            b"solid a",
            b"<robot name='r'/>",
            b"\x89PNG\r\n\x1a\n",
            b"\xff\xd8\xff\xe0",
            b"ply\n",
            b"version = 1",
            b"\x08\x08\x12\x07pytorch",
            b"<?xml version='1.0'?><COLLADA/>",
        ];
        assert!(files.into_iter().all(|bytes| instead(bytes).is_none()));
        assert!(crate::files::builtin().iter().all(|(_, bytes)| instead(bytes).is_none()));
    }
}
