//! Names that were mistyped, and which of the known ones may have been meant.

/// `; did you mean 'x'?` where one of the known names is near to what was typed, else nothing: the end of an error's text.
///
/// ```
/// assert_eq!(grip_sim::names::suggestion(["base", "dark"], "drak"), "; did you mean 'dark'?");
/// assert_eq!(grip_sim::names::suggestion(["base", "dark"], "fog"), "");
/// ```
pub fn suggestion<'a>(known: impl IntoIterator<Item = &'a str>, typed: &str) -> String {
    nearest(known, typed).map(|name| format!("; did you mean '{name}'?")).unwrap_or_default()
}

/// The known name that is nearest to what was typed, if any is near.
pub fn nearest<'a>(known: impl IntoIterator<Item = &'a str>, typed: &str) -> Option<&'a str> {
    known.into_iter().filter_map(|known| Some((edits(known, typed)?, known))).min().map(|(_, known)| known)
}

/// How many letters were mistyped, if `known` may have been meant: the whole name or the one without its number. 0 where
/// `typed` is a part of it.
fn edits(known: &str, typed: &str) -> Option<usize> {
    let (known, typed) = (known.to_ascii_lowercase(), typed.to_ascii_lowercase());
    if !typed.is_empty() && known.contains(&typed) {
        return Some(0);
    }
    let unnumbered = known.split_once('_').map_or(known.as_str(), |(_, name)| name);
    let edits = strsim::osa_distance(&known, &typed).min(strsim::osa_distance(unnumbered, &typed));
    // A guess must share at least half of what was typed.
    (edits <= 5 && 2 * edits <= typed.len()).then_some(edits)
}

/// Of a parser's message about an unknown field or variant, which lists those there are: the nearest.
pub fn suggestion_in(message: &str) -> String {
    let asked = ["unknown field `", "unknown variant `"].iter().find_map(|start| message.split_once(start));
    let Some((typed, rest)) = asked.and_then(|(_, rest)| rest.split_once('`')) else { return String::new() };
    // What is in backquotes stands between every second pair of them.
    suggestion(rest.lines().next().unwrap_or_default().split('`').skip(1).step_by(2), typed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_suggested_and_no_far_one() {
        let known = ["002_master_chef_can", "005_tomato_soup_can", "025_mug"];
        assert_eq!(nearest(known, "tomato"), Some("005_tomato_soup_can"));
        assert_eq!(nearest(known, "mugg"), Some("025_mug"));
        assert_eq!(nearest(known, "qqqqqqq"), None);
        assert_eq!(nearest(known, ""), None);
    }

    #[test]
    fn what_a_parser_lists_is_searched() {
        let message = "unknown field `frictoin`, expected one of `name`, `friction`, `mesh`\nat line 3";
        assert_eq!(suggestion_in(message), "; did you mean 'friction'?");
        assert_eq!(suggestion_in("unknown field `x`, there are no fields"), "");
        assert_eq!(suggestion_in("missing field `name`"), "");
    }
}
