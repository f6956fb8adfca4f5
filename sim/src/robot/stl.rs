//! STL files, binary and text, as exporters write them.
//!
//! Capitals, a byte order mark, comments, a name of several lines, all in one line, bytes after the last triangle and a binary header
//! that begins with `solid` do no harm. Normals are left out: exporters leave them zero or wrong.

use nalgebra::Point3;

use crate::files::text;
use crate::mesh::Mesh;

/// What comes before the triangles of a binary file: 80 bytes of anything, and how many there are.
const HEADER: usize = 84;
/// A triangle: a normal and three vertices of three floats, and two bytes of anything.
const TRIANGLE: usize = 50;

/// The triangles of a file, three vertices each.
///
/// # Errors
/// If it is cut off, or holds what is no number: the line, where it is text.
pub(super) fn load(bytes: &[u8]) -> Result<Mesh, String> {
    let positions = if is_text(bytes) { of_text(&text::lenient(bytes.into()))? } else { of_binary(bytes)? };
    Ok(Mesh {
        triangles: (0..positions.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        positions,
        ..Mesh::default()
    })
}

/// How many triangles a binary file says it has.
fn count(bytes: &[u8]) -> Option<usize> {
    let count: [u8; 4] = bytes.get(HEADER - 4..HEADER)?.try_into().ok()?;
    Some(u32::from_le_bytes(count) as usize)
}

/// Text begins with `solid`; so do headers of binary files, which the length or bytes that are no text give away.
fn is_text(bytes: &[u8]) -> bool {
    let mut head = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    while head.starts_with(b"#") {
        let end = head.iter().position(|byte| matches!(byte, b'\n' | b'\r')).unwrap_or(head.len());
        head = head[end..].trim_ascii_start();
    }
    let solid = head.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    let binary = count(bytes).is_some_and(|count| bytes.len() == HEADER + TRIANGLE * count)
        || bytes.iter().take(512).any(|&byte| byte == 0);
    // Wide text has zeros, and its mark.
    solid && !binary || bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff")
}

fn of_binary(bytes: &[u8]) -> Result<Vec<Point3<f32>>, String> {
    let count = count(bytes).ok_or_else(|| {
        format!(
            "is no STL file: it does not begin with 'solid', and {} bytes are too few for a binary one",
            bytes.len()
        )
    })?;
    let (triangles, _) = bytes[HEADER..].as_chunks::<TRIANGLE>();
    if triangles.len() < count {
        return Err(format!("binary STL is cut off: {} of {count} triangles", triangles.len()));
    }
    // Bytes behind the last triangle are an exporter's own, but not where they are triangles too.
    let more = bytes.len() - HEADER - TRIANGLE * count;
    if more > 0 && (count == 0 || more.is_multiple_of(TRIANGLE) && triangles[count..].iter().any(is_triangle))
    {
        return Err(format!(
            "binary STL says that it has {count} triangles, but goes on for {more} bytes, {} triangles more; write it again, or put \
             their number into bytes 80 to 83",
            more / TRIANGLE
        ));
    }
    let vertex = |bytes: &[u8]| {
        let (floats, _) = bytes.as_chunks::<4>();
        Point3::from(std::array::from_fn::<f32, 3, _>(|i| f32::from_le_bytes(floats[i])))
    };
    Ok(triangles[..count].iter().flat_map(|t| [&t[12..24], &t[24..36], &t[36..48]].map(vertex)).collect())
}

fn begins<'a>(mut words: impl Iterator<Item = &'a str>, with: [&str; 2]) -> bool {
    with.iter().all(|word| words.next().is_some_and(|next| next.eq_ignore_ascii_case(word)))
}

/// Whether bytes can be a triangle with an area.
fn is_triangle(bytes: &[u8; TRIANGLE]) -> bool {
    let (floats, _) = bytes[..48].as_chunks::<4>();
    let floats = floats.iter().map(|bytes| f32::from_le_bytes(*bytes));
    floats.clone().all(f32::is_finite) && floats.skip(3).any(|value| value.abs() > 1e-9)
}

fn of_text(text: &str) -> Result<Vec<Point3<f32>>, String> {
    let mut positions: Vec<Point3<f32>> = Vec::new();
    // Where the facet began that is being read, and whether one was seen in this solid, or its end.
    let (mut facet, mut named, mut ended) = (None, false, false);
    for (index, line) in text.split(['\n', '\r']).enumerate() {
        let wrong = |what: String| format!("text STL, line {}: {what}", index + 1);
        if line.trim_start().starts_with('#') {
            continue;
        }
        let mut words = line.split_ascii_whitespace();
        while let Some(word) = words.next() {
            match word.to_ascii_lowercase().as_str() {
                // The rest of the line is a name, or there is but one line.
                "solid" | "endsolid" if facet.is_none() => {
                    while !words.clone().next().is_none_or(|word| word.eq_ignore_ascii_case("endsolid"))
                        && !begins(words.clone(), ["facet", "normal"])
                    {
                        words.next();
                    }
                    (named, ended) = (false, word.len() > "solid".len() && words.clone().next().is_none());
                }
                "facet" if facet.is_none() => {
                    (facet, named) = (Some(positions.len()), true);
                    words.by_ref().take(4).for_each(drop);
                }
                "outer" if facet.is_some() => drop(words.next()),
                "endloop" if facet.is_some() => {}
                "vertex" if facet.is_some() => {
                    let mut number = || {
                        let word = words.next().unwrap_or("nothing");
                        word.parse::<f32>().map_err(|_| wrong(format!("'{word}' is no number")))
                    };
                    positions.push(Point3::new(number()?, number()?, number()?));
                }
                "endfacet" => {
                    let vertices = facet.take().map_or(0, |start| positions.len() - start);
                    if vertices != 3 {
                        return Err(wrong(format!("a facet of {vertices} vertices; a triangle has three")));
                    }
                }
                // A name of several lines.
                _ if !named => break,
                _ => return Err(wrong(format!("'{word}' is not expected here"))),
            }
        }
    }
    if !ended || facet.is_some() {
        return Err(format!(
            "text STL is cut off after {} triangles: it has no 'endsolid'",
            positions.len() / 3
        ));
    }
    Ok(positions)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "solid a part\nfacet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1e0 0 0\n  vertex 0 1 0\n \
                        endloop\nendfacet\nendsolid a part\n";

    fn binary(header: &[u8], triangles: usize) -> Vec<u8> {
        let mut bytes = vec![b' '; 80];
        bytes[..header.len()].copy_from_slice(header);
        bytes.extend((triangles as u32).to_le_bytes());
        for _ in 0..triangles {
            bytes.extend([0; 12]);
            bytes.extend(
                [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].into_iter().flat_map(f32::to_le_bytes),
            );
            bytes.extend([0; 2]);
        }
        bytes
    }

    #[test]
    fn the_same_triangle_however_it_is_written() {
        let wide: Vec<u8> =
            std::iter::once(0xfeff).chain(TEXT.encode_utf16()).flat_map(u16::to_le_bytes).collect();
        let files: [(&str, Vec<u8>); 15] = [
            ("text", TEXT.into()),
            ("capitals", TEXT.to_uppercase().into()),
            ("byte order mark", format!("\u{feff}{TEXT}").into()),
            ("wide", wide),
            ("line ends of an old Mac", TEXT.replace('\n', "\r").into()),
            ("a name of lines", TEXT.replacen("a part", "a part\nmade by X\nfor Y", 1).into()),
            ("a name of another encoding", [b"solid gr\xfcn\n".as_slice(), &TEXT.as_bytes()[13..]].concat()),
            ("no name, spaces before", TEXT.replace(" a part", "").replacen("solid", "  solid", 1).into()),
            ("one line", TEXT.replace('\n', " ").into()),
            ("a comment before", format!("# facet of X\n{TEXT}").into()),
            ("a name that is a keyword", TEXT.replace("a part", "facet").into()),
            ("binary", binary(b"", 1)),
            ("binary that begins with solid", binary(b"solid exported by Z", 1)),
            ("binary and more", [binary(b"", 1), vec![7; 33]].concat()),
            ("binary with line breaks", binary(b"solid\r\nCOLOR=\0\0\r\n", 1)),
        ];
        let triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(Point3::from);
        for (what, bytes) in files {
            let mesh = load(&bytes).unwrap_or_else(|error| panic!("{what}: {error}"));
            assert_eq!(
                (mesh.positions.as_slice(), mesh.triangles.as_slice()),
                (&triangle[..], &[[0, 1, 2]][..]),
                "{what}"
            );
        }
        let two = format!("{TEXT}{}", TEXT.replace("solid", "SOLID"));
        for two in [two.replace('\n', " "), two] {
            assert_eq!(load(two.as_bytes()).unwrap().triangles, [[0, 1, 2], [3, 4, 5]]);
        }
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (from, to, wanted) in [
            ("vertex 0 1 0", "vertex 0 1,5 0", "line 6: '1,5'"),
            ("  vertex 0 1 0\n", "", "line 7: a facet of 2 vertices"),
            ("endloop", "end loop", "line 7: 'end'"),
            ("endsolid a part\n", "", "cut off after 1 triangles"),
        ] {
            let error = load(TEXT.replacen(from, to, 1).as_bytes()).unwrap_err();
            assert!(error.contains(wanted), "{error}");
        }
        let all = binary(b"solid", 3);
        assert!(load(&all[..all.len() - 1]).unwrap_err().contains("2 of 3"));
        assert!(load(&binary(b"", 3)[..70]).unwrap_err().contains("70 bytes"));
        let mut none = binary(b"", 3);
        none[80..84].fill(0);
        assert!(
            load(&none).unwrap_err().contains("it has 0 triangles, but goes on for 150 bytes, 3 triangles")
        );
        none[80] = 2;
        assert!(load(&none).unwrap_err().contains("it has 2 triangles"));
        let padded = [binary(b"", 3), vec![0; 100]].concat();
        assert_eq!(load(&padded).unwrap().triangles.len(), 3);
    }
}
