//! The message of a commit while it is written: words, trailers, comments, and perhaps a diff below scissors. It is
//! bytes, because it may be in another encoding.

/// What git's line of scissors has behind the comment character.
const SCISSORS: &[u8] = b" ------------------------ >8 ------------------------";

/// A message and the character, or more, that comments begin with.
pub struct Message<'m> {
    lines: Vec<&'m [u8]>,
    comment: &'m str,
}

impl<'m> Message<'m> {
    /// The message in a file.
    pub fn new(text: &'m [u8], comment: &'m str) -> Message<'m> {
        Message { lines: text.split_inclusive(|&byte| byte == b'\n').collect(), comment }
    }

    /// With a text below the words, above trailers, comments and scissors.
    pub fn with(&self, text: &str) -> Vec<u8> {
        let at = self.end_of_words();
        let mut words = self.lines[..at].concat();
        words.truncate(words.trim_ascii_end().len());
        // The first line is left for the subject.
        let mut message = if words.is_empty() { b"\n".to_vec() } else { [&words[..], b"\n\n"].concat() };
        if words.is_empty() {
            message.push(b'\n');
        }
        for line in text.trim_end().lines() {
            if line.starts_with(self.comment) {
                // Git would take it for a comment and leave it out.
                message.push(b' ');
            }
            message.extend_from_slice(line.as_bytes());
            message.push(b'\n');
        }
        let rest: Vec<u8> =
            self.lines[at..].iter().skip_while(|line| is_blank(line)).copied().collect::<Vec<_>>().concat();
        if !rest.is_empty() {
            message.push(b'\n');
        }
        [message, rest].concat()
    }

    /// With remarks among git's own comments, below the scissors where there are any; nothing where there are no
    /// comments of git's to be among.
    pub fn with_remarks(&self, remarks: &[String]) -> Option<Vec<u8>> {
        let at = match self.scissors() {
            // The line itself and those that explain it.
            Some(at) => at + self.lines[at..].iter().take_while(|line| self.is_comment(line)).count(),
            None if self
                .lines
                .iter()
                .rev()
                .find(|line| !is_blank(line))
                .is_some_and(|last| self.is_comment(last)) =>
            {
                self.lines.len()
            }
            None => return None,
        };
        let mut message = self.lines[..at].concat();
        if !message.ends_with(b"\n") {
            message.push(b'\n');
        }
        for line in remarks.iter().flat_map(|remark| remark.lines()) {
            message.extend_from_slice(format!("{} {line}\n", self.comment).as_bytes());
        }
        message.extend_from_slice(&self.lines[at..].concat());
        Some(message)
    }

    /// The place before trailers, comments at the end, and scissors.
    fn end_of_words(&self) -> usize {
        let end = self.scissors().unwrap_or(self.lines.len());
        let skipped = |line: &&&[u8]| is_blank(line) || self.is_comment(line);
        let end = end - self.lines[..end].iter().rev().take_while(skipped).count();
        // The last paragraph, unless it is the first one too: that is the subject.
        let trailers = self.lines[..end].iter().rev().take_while(|line| !is_blank(line)).count();
        let all = self.lines[end - trailers..end].iter().all(|line| is_trailer(line));
        if trailers < end && all { end - trailers } else { end }
    }

    fn scissors(&self) -> Option<usize> {
        let is = |line: &&[u8]| {
            line.strip_prefix(self.comment.as_bytes()).is_some_and(|rest| rest.trim_ascii_end() == SCISSORS)
        };
        self.lines.iter().position(is)
    }

    fn is_comment(&self, line: &[u8]) -> bool {
        line.starts_with(self.comment.as_bytes())
    }
}

fn is_blank(line: &[u8]) -> bool {
    line.trim_ascii().is_empty()
}

/// Such as `Signed-off-by: …`.
fn is_trailer(line: &[u8]) -> bool {
    let Some(colon) = line.iter().position(|&byte| byte == b':') else { return false };
    let (name, value) = (&line[..colon], &line[colon + 1..]);
    let in_name = |byte: &u8| byte.is_ascii_alphanumeric() || *byte == b'-';
    !name.is_empty() && name.iter().all(in_name) && value.starts_with(b" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn with(message: &str, expected: &str) {
        let found = Message::new(message.as_bytes(), "#").with("Changes:\n  ~\n\n");
        assert_eq!(String::from_utf8(found).unwrap(), expected);
    }

    #[test]
    fn the_text_is_below_the_words() {
        with("Subject\n", "Subject\n\nChanges:\n  ~\n");
        with("Subject", "Subject\n\nChanges:\n  ~\n");
        with("Subject\n\nWords.\n\n\n", "Subject\n\nWords.\n\nChanges:\n  ~\n");
        with("Subject: short\n", "Subject: short\n\nChanges:\n  ~\n");
    }

    #[test]
    fn the_first_line_is_left_for_the_subject() {
        with("", "\n\nChanges:\n  ~\n");
        with("\n# Please enter\n#\n", "\n\nChanges:\n  ~\n\n# Please enter\n#\n");
    }

    #[test]
    fn comments_trailers_and_scissors_stay_at_the_end() {
        with(
            "S\n# in the middle\nW\n\n# a\n\n# b\n",
            "S\n# in the middle\nW\n\nChanges:\n  ~\n\n# a\n\n# b\n",
        );
        with(
            "S\n\nW\n\nSigned-off-by: A <a@b>\nCo-authored-by: C\n\n# a\n",
            "S\n\nW\n\nChanges:\n  ~\n\nSigned-off-by: A <a@b>\nCo-authored-by: C\n\n# a\n",
        );
        with("\n\nSigned-off-by: A\n", "\n\nChanges:\n  ~\n\nSigned-off-by: A\n");
        let below = "# ------------------------ >8 ------------------------\n# Do not\ndiff --git\n+x: y\n";
        with(&format!("S\n{below}"), &format!("S\n\nChanges:\n  ~\n\n{below}"));
        with(&format!("S\n\n# a\n{below}"), &format!("S\n\nChanges:\n  ~\n\n# a\n{below}"));
    }

    #[test]
    fn a_line_that_looks_like_a_comment_is_moved() {
        let found = Message::new(b"S\n; git\n", ";").with("a\n;b\n");
        assert_eq!(found, b"S\n\na\n ;b\n\n; git\n");
        let found = Message::new(b"\xff\xfe\n", "#").with("a");
        assert_eq!(found, b"\xff\xfe\n\na\n");
    }

    #[test]
    fn remarks_are_among_comments() {
        let remark = |message: &str| {
            let found = Message::new(message.as_bytes(), "#").with_remarks(&["a\nb".into()])?;
            Some(String::from_utf8(found).unwrap())
        };
        assert_eq!(remark("S\n"), None);
        assert_eq!(remark(""), None);
        assert_eq!(remark("\n# git").unwrap(), "\n# git\n# a\n# b\n");
        let line = "# ------------------------ >8 ------------------------\n# Do not\n";
        let found = remark(&format!("S\n{line}diff --git\n")).unwrap();
        assert_eq!(found, format!("S\n{line}# a\n# b\ndiff --git\n"));
    }
}
