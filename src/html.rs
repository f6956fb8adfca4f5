//! What the pages of trials and experiments share. A page is one file and needs no network.

use std::fmt::Write as _;

use base64::Engine as _;

use crate::provenance::Provenance;

/// Of all pages.
pub const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;max-width:1180px;margin:2em auto;padding:0 1em;color:#1b1f24}\
h1{font-size:1.5em}h2{font-size:1.15em;margin-top:2em}table{border-collapse:collapse;width:100%}\
svg{max-width:100%;height:auto}th,td{text-align:left;padding:.35em .6em;border-bottom:1px solid #d5dae0}td.n,th.n{text-align:right;font-variant-numeric:tabular-nums}\
.ok{color:#11713a;font-weight:600}.bad{color:#a3261b;font-weight:600}.note{background:#fff4d6;padding:.6em 1em;border-radius:6px}\
.look{display:flex;gap:8px;flex-wrap:wrap}.look figure{margin:0;flex:1 1 320px}.look img{width:100%;border-radius:4px}\
.strip{display:flex;gap:6px;margin:.4em 0}.strip figure{margin:0;flex:1 1 0;max-width:25%}.strip img{width:100%;border-radius:4px}\
.kind{margin:0;color:#57606a;font-weight:600}h1{margin:.1em 0 .5em}\
.made{width:auto;margin-bottom:1.2em;font-size:.85em;color:#57606a}.made td{padding:.1em 1em .1em 0;border:0;vertical-align:top}.made code{overflow-wrap:anywhere}\
.figures{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(520px,100%),1fr));gap:12px}.w{white-space:nowrap}td code{font-size:.85em}\
figcaption{font-size:.85em;color:#57606a}.key{display:inline-block;width:.8em;height:.8em;border-radius:2px;margin-right:.4em}";

/// The beginning of a page: what kind of thing it shows, what came out, and where it comes from. `renderer` drew what the page shows, if
/// one did. All are text.
pub fn begin(page: &mut String, kind: &str, title: &str, renderer: Option<&str>) {
    let Provenance { program, command, date, cpu, cores } = Provenance::now();
    let _ = write!(
        page,
        "<!doctype html><html lang=en><meta charset=utf-8><title>GRIP: {kind}: {title}</title><style>{STYLE}</style>\
         <p class=kind>{kind}</p><h1>{title}</h1>",
        kind = escape(kind),
        title = escape(title),
    );
    let commit =
        if program.commit == "unknown" { String::new() } else { format!(", commit {}", program.commit) };
    let renderer = renderer.map_or_else(String::new, |name| format!("; renderer {name}"));
    page.push_str("<table class=made>");
    for (name, value) in [
        ("program", format!("grip {}{commit}, {}", program.version, program.target)),
        ("command", command),
        ("date", date),
        ("machine", format!("{cpu}, {cores} cores{renderer}")),
    ] {
        let value = escape(&value);
        let value = if name == "command" { format!("<code>{value}</code>") } else { value };
        let _ = write!(page, "<tr><td>{name}<td>{value}</tr>");
    }
    page.push_str("</table>");
}

/// A picture with its caption, both as they are.
pub fn picture(page: &mut String, kind: &str, bytes: &[u8], caption: &str) {
    let data = base64::engine::general_purpose::STANDARD.encode(bytes);
    let _ = write!(
        page,
        "<figure><img alt='{caption}' src='data:{kind};base64,{data}'><figcaption>{caption}</figcaption></figure>"
    );
}

/// Text as it is shown.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
        .replace('\'', "&#39;")
}

/// A table; `right` names the columns of numbers. Cells are text.
pub fn table(
    page: &mut String,
    header: &[&str],
    right: &[usize],
    rows: impl IntoIterator<Item = Vec<String>>,
) {
    let class = |i: usize| if right.contains(&i) { " class=n" } else { "" };
    page.push_str("<table><tr>");
    for (i, name) in header.iter().enumerate() {
        let _ = write!(page, "<th{}>{}", class(i), escape(name));
    }
    page.push_str("</tr>");
    for row in rows {
        page.push_str("<tr>");
        for (i, cell) in row.iter().enumerate() {
            let _ = write!(page, "<td{}>{}", class(i), escape(cell));
        }
        page.push_str("</tr>");
    }
    page.push_str("</table>");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_begins_with_what_it_is_and_where_it_comes_from() {
        let mut page = String::new();
        let words = ["grip", "pack", "--out", "a & b"].map(str::to_owned).to_vec();
        crate::provenance::asked_by(words, || begin(&mut page, "One trial", "5 < 6", Some("wgpu")));
        assert!(page.contains("<title>GRIP: One trial: 5 &lt; 6</title>"), "{page}");
        let made = &page[page.find("<table class=made>").unwrap()..];
        assert!(made.contains(concat!("<td>grip ", env!("CARGO_PKG_VERSION"))), "{made}");
        assert!(made.contains("<code>grip pack --out &#39;a &amp; b&#39;</code>"), "{made}");
        assert!(made.contains(" UTC</tr>") && made.contains(" cores; renderer wgpu</tr>"), "{made}");
    }
}
