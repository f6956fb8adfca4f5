"""The documentation says what is there: the drawn tree of folders, the links, the length of the README.

Usage: check_docs.py          from anywhere; prints each fault as FILE:LINE: TEXT, and ends with 1 if there is one.

1. The tree in docs/architecture.md (the block that begins with ```text tree) has every folder that git tracks, but for those
   deeper than two levels under a `src` or in a `corpus`, and no folder that is not there; each has a word of what it holds.
2. README.md has at most 150 lines.
3. Relative links in README.md, CONTRIBUTING.md, CHANGELOG.md, docs/*.md and perception/models/*.md point to something,
   their anchors to a heading.
"""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TREE_PAGE = ROOT / "docs" / "architecture.md"
MOST_README_LINES = 150
MOST_LEVELS_UNDER_SRC = 2
FENCE = re.compile(r"^\s*(```+|~~~+)(.*)$")
INLINE_CODE = re.compile(r"`[^`]*`")
# The text may hold an image, whose own link is found on its own.
LINK = re.compile(r"\]\(\s*<?([^)\s>]+)>?(?:\s+\"[^\"]*\")?\s*\)")

faults: list[str] = []


def fault(path: Path, line: int, text: str) -> None:
    faults.append(f"{path.relative_to(ROOT)}:{line}: {text}")


def tracked_folders() -> set[str]:
    """Folders of tracked files that are on the disk, with all folders above them."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True).stdout
    folders: set[str] = set()
    for name in filter(None, listed.decode().split("\0")):
        if (ROOT / name).exists():
            folders.update(str(parent) for parent in Path(name).parents if parent != Path("."))
    return folders


def must_be_drawn(folder: str) -> bool:
    parts = folder.split("/")
    if "corpus" in parts[:-1]:
        return False
    return "src" not in parts or len(parts) - 1 - parts.index("src") <= MOST_LEVELS_UNDER_SRC


def drawn_folders() -> tuple[dict[str, int], int]:
    """The folders of the tree with their lines, and the line where the tree begins."""
    drawn: dict[str, int] = {}
    begin, path = 0, []
    for number, line in enumerate(TREE_PAGE.read_text(encoding="utf-8").splitlines(), 1):
        if not begin:
            if re.match(r"^```text tree\s*$", line):
                begin = number
            continue
        if line.startswith("```"):
            return drawn, begin
        entry = re.match(r"^( *)(\S+)/(?:\s+(\S.*))?$", line)
        if not entry:
            fault(TREE_PAGE, number, f"no folder and its word: {line!r}")
            continue
        depth = len(entry[1]) // 2
        if len(entry[1]) % 2 or depth > len(path):
            fault(TREE_PAGE, number, f"{entry[2]}/ is indented by {len(entry[1])}: two spaces a level")
            continue
        path = path[:depth] + [entry[2]]
        folder = "/".join(path)
        if not entry[3]:
            fault(TREE_PAGE, number, f"{folder}/ has no word of what it holds")
        if folder in drawn:
            fault(TREE_PAGE, number, f"{folder}/ stands twice, first on line {drawn[folder]}")
        drawn[folder] = number
    fault(TREE_PAGE, max(begin, 1), "has no whole block ```text tree")
    return drawn, max(begin, 1)


def check_tree() -> None:
    tracked = tracked_folders()
    drawn, begin = drawn_folders()
    for folder in sorted(tracked - drawn.keys()):
        if must_be_drawn(folder):
            fault(TREE_PAGE, begin, f"{folder}/ is tracked and not in the tree")
    for folder, line in drawn.items():
        if folder not in tracked:
            fault(TREE_PAGE, line, f"{folder}/ is in the tree, but there is no tracked folder of that name")


def check_length() -> None:
    lines = (ROOT / "README.md").read_text(encoding="utf-8").count("\n")
    if lines > MOST_README_LINES:
        fault(ROOT / "README.md", lines, f"has {lines} lines: at most {MOST_README_LINES}")


def prose(path: Path) -> list[tuple[int, str]]:
    """The lines outside of code, with their numbers."""
    lines, fence = [], None
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        mark = FENCE.match(line)
        if mark and (fence is None or (mark[1].startswith(fence) and not mark[2].strip())):
            fence = mark[1] if fence is None else None
        elif fence is None:
            lines.append((number, line))
    return lines


def anchors(path: Path) -> set[str]:
    """The anchors of the headings, as GitHub names them."""
    found: set[str] = set()
    for _, line in prose(path):
        heading = re.match(r"^#{1,6}\s+(.*?)\s*#*$", line)
        if heading:
            text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading[1]).lower()
            name = re.sub(r"[^\w\- ]", "", text).replace(" ", "-")
            same = sum(1 for other in found if other == name or re.fullmatch(re.escape(name) + r"-\d+", other))
            found.add(f"{name}-{same}" if same else name)
    return found


def check_links(path: Path) -> None:
    for number, line in prose(path):
        for link in LINK.findall(INLINE_CODE.sub("`", line)):
            if re.match(r"^[a-z][a-z0-9+.-]*:", link):
                continue
            name, _, anchor = link.partition("#")
            target = (path.parent / name).resolve() if name else path
            if not target.is_relative_to(ROOT):
                fault(path, number, f"{link} points out of the repository")
            elif not target.exists():
                fault(path, number, f"{link} points nowhere")
            elif anchor and target.suffix == ".md" and anchor not in anchors(target):
                fault(path, number, f"{link}: {target.relative_to(ROOT)} has no heading of that name")


def main() -> int:
    check_tree()
    check_length()
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]
    pages += sorted((ROOT / "docs").glob("*.md")) + sorted((ROOT / "perception" / "models").glob("*.md"))
    for page in pages:
        if page.exists():
            check_links(page)
        else:
            fault(page, 1, "is missing")
    print("\n".join(faults) if faults else f"{len(pages)} pages, the tree and all links are as they should be")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
