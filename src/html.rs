//! What the pages of trials and experiments share. A page is one file and needs no network.

use std::fmt::Write as _;

use base64::Engine as _;

/// Of all pages.
pub const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;max-width:1180px;margin:2em auto;padding:0 1em;color:#1b1f24}\
h1{font-size:1.5em}h2{font-size:1.15em;margin-top:2em}table{border-collapse:collapse;width:100%}\
svg{max-width:100%;height:auto}th,td{text-align:left;padding:.35em .6em;border-bottom:1px solid #d5dae0}td.n,th.n{text-align:right;font-variant-numeric:tabular-nums}\
.ok{color:#11713a;font-weight:600}.bad{color:#a3261b;font-weight:600}.note{background:#fff4d6;padding:.6em 1em;border-radius:6px}\
.look{display:flex;gap:8px;flex-wrap:wrap}.look figure{margin:0;flex:1 1 320px}.look img{width:100%;border-radius:4px}\
.strip{display:flex;gap:6px;margin:.4em 0}.strip figure{margin:0;flex:1 1 0;max-width:25%}.strip img{width:100%;border-radius:4px}\
figcaption{font-size:.85em;color:#57606a}.key{display:inline-block;width:.8em;height:.8em;border-radius:2px;margin-right:.4em}";

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
