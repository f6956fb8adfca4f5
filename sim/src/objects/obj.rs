//! Wavefront OBJ files and their material libraries, as people's programs write them.
//!
//! `tobj` reads them, after what it does not bear is put right: text in an 8-bit encoding, colours of fewer than three numbers (on
//! which it panics), options before a texture's name (which it takes for a part of it).

use std::cell::RefCell;
use std::path::Path;

use crate::files::{self, text::lenient};
use crate::{Error, Result};

/// Models and materials of an OBJ file, its faces cut into triangles. Of a material library that is not there the materials are
/// missing, and `absent` holds its name.
///
/// # Errors
/// What is wrong with the file, or with a material library: its name, line and keyword.
pub(crate) fn load(path: &Path) -> Result<Obj> {
    let folder = path.parent().unwrap_or(Path::new("."));
    let (wrong, absent) = (RefCell::new(None), RefCell::new(None));
    let library = |name: &Path| {
        let path = folder.join(name);
        let shown = path.display().to_string();
        if !files::exists(&path) {
            absent.replace(Some(shown));
            return Ok(Default::default());
        }
        let bytes = files::read(&path).map_err(Error::without_file);
        let mended = bytes.and_then(|bytes| mended_library(&lenient(bytes)));
        mended
            .and_then(|text| tobj::load_mtl_buf(&mut text.as_bytes()).map_err(|error| error.to_string()))
            .map_err(|reason| {
                wrong.replace(Some(format!("its material library {shown}: {reason}")));
                tobj::LoadError::MaterialParseError
            })
    };
    let object = lenient(files::read(path)?);
    let unreadable = |reason: String| Error::invalid(path, format!("not a readable OBJ file: {reason}"));
    let (models, materials) = tobj::load_obj_buf(&mut object.as_bytes(), &tobj::GPU_LOAD_OPTIONS, library)
        .map_err(|error| unreadable(error.to_string()))?;
    let materials =
        materials.map_err(|error| unreadable(wrong.take().unwrap_or_else(|| error.to_string())))?;
    Ok(Obj { models, materials, absent: absent.take() })
}

/// An OBJ file.
pub(crate) struct Obj {
    pub models: Vec<tobj::Model>,
    pub materials: Vec<tobj::Material>,
    /// A material library that it names and that is not there.
    pub absent: Option<String>,
}

/// A material library with what `tobj` does not bear put right.
fn mended_library(text: &str) -> std::result::Result<String, String> {
    let mut mended = String::with_capacity(text.len());
    for (i, line) in text.lines().enumerate() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let of_line = |reason: String| format!("line {}, '{}': {reason}", i + 1, line.trim());
        match words.first() {
            Some(keyword @ (&"Ka" | &"Kd" | &"Ks" | &"Ke")) => {
                let values: Vec<&str> =
                    words[1..].iter().copied().take_while(|word| !word.starts_with('#')).collect();
                mended += &format!("{keyword} {}", color(&values).map_err(of_line)?);
            }
            Some(keyword) if keyword.starts_with("map_") || *keyword == "norm" => {
                mended += &format!("{keyword} {}", map_name(line.trim_start()[keyword.len()..].trim()));
            }
            _ => mended += line,
        }
        mended.push('\n');
    }
    Ok(mended)
}

/// Three numbers; green and blue may be left out, and are then as red.
fn color(words: &[&str]) -> std::result::Result<String, String> {
    let number = |word: &&str| word.parse::<f32>().is_ok();
    match words {
        [r] if number(r) => Ok(format!("{r} {r} {r}")),
        [r, g] if number(r) && number(g) => Ok(format!("{r} {g} {r}")),
        [r, g, b, ..] if [r, g, b].into_iter().all(number) => Ok(format!("{r} {g} {b}")),
        [] => Err("needs a colour, three numbers".into()),
        _ => Err("is not a colour of three numbers; spectra and CIE XYZ are not read".into()),
    }
}

/// The name of a texture behind its options, which are not followed.
fn map_name(text: &str) -> &str {
    let mut rest = text;
    while let Some(option) = rest.split_whitespace().next().filter(|word| word.starts_with('-')) {
        let values = match option {
            "-o" | "-s" | "-t" => 3,
            "-mm" => 2,
            "-blendu" | "-blendv" | "-boost" | "-bm" | "-cc" | "-clamp" | "-imfchan" | "-texres"
            | "-type" => 1,
            // A file's name may begin with a hyphen.
            _ => break,
        };
        log::warn!("texture option {option} is not followed: {text}");
        rest = rest[option.len()..].trim_start();
        for i in 0..values {
            let Some(word) = rest.split_whitespace().next() else { break };
            // Of three numbers one may stand alone.
            if values == 3 && i > 0 && word.parse::<f32>().is_err() {
                break;
            }
            rest = rest[word.len()..].trim_start();
        }
    }
    rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_colour_of_fewer_numbers_is_grey_and_one_of_none_is_an_error_with_its_line() {
        let mended = |text: &str| mended_library(text).unwrap();
        assert_eq!(
            mended("newmtl a\n\tKd 0.6\r\nKs .1 .2 # of print\n"),
            "newmtl a\nKd 0.6 0.6 0.6\nKs .1 .2 .1\n"
        );
        assert_eq!(mended("Ka 0.1 0.2 0.3 0.4\nNs 10\n"), "Ka 0.1 0.2 0.3\nNs 10\n");
        let error = mended_library("newmtl a\nKe\n").unwrap_err();
        assert_eq!(error, "line 2, 'Ke': needs a colour, three numbers");
        let error = mended_library("Kd spectral film.rfl 1").unwrap_err();
        assert!(error.contains("line 1") && error.contains("spectra"), "{error}");
        assert!(mended_library("Kd red green blue").is_err());
    }

    #[test]
    fn options_are_no_part_of_a_textures_name() {
        let cases = [
            ("label.png", "label.png"),
            ("-s 2 2 1 label.png", "label.png"),
            ("-s 2 -o 0.5 0.5 -clamp on my label.png", "my label.png"),
            ("-mm 0 1 -bm 0.5 -texres 512 a.png", "a.png"),
            ("-strange.png", "-strange.png"),
            ("-s 1 1", ""),
            ("", ""),
        ];
        for (text, wanted) in cases {
            assert_eq!(map_name(text), wanted, "{text}");
        }
    }
}
