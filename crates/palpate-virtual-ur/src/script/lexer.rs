//! Text to words.

use super::error::{ErrorKind, ScriptError};

/// A word of the language.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Word {
    Name(String),
    Int(i32),
    Float(f64),
    Text(String),
    /// `p[`, the start of a pose.
    PoseOpen,
    /// An operator or bracket.
    Sign(&'static str),
    /// The end of a statement.
    Newline,
    End,
}

impl std::fmt::Display for Word {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Name(name) => write!(f, "{name}"),
            Self::Int(i) => write!(f, "{i}"),
            Self::Float(x) => write!(f, "{x}"),
            Self::Text(text) => write!(f, "{text:?}"),
            Self::PoseOpen => f.write_str("p["),
            Self::Sign(sign) => f.write_str(sign),
            Self::Newline => f.write_str("the end of the line"),
            Self::End => f.write_str("the end of the program"),
        }
    }
}

/// A word and its line.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Token {
    pub(crate) word: Word,
    pub(crate) line: u32,
}

/// Longest first, so that `<=` is not `<` and `=`.
const SIGNS: &[&str] =
    &["==", "!=", "<=", ">=", "<", ">", "=", "+", "-", "*", "/", "%", "(", ")", "[", "]", ",", ":"];

/// All words of `text`, with one [`Word::End`] last. A newline inside brackets ends no statement.
pub(crate) fn lex(text: &str) -> Result<Vec<Token>, ScriptError> {
    let mut tokens = Vec::new();
    let (mut rest, mut line, mut brackets) = (text, 1, 0u32);
    while let Some(first) = rest.chars().next() {
        let (word, length) = match first {
            '\n' if brackets == 0 => (Some(Word::Newline), 1),
            '#' => (None, rest.find('\n').unwrap_or(rest.len())),
            c if c.is_whitespace() => (None, c.len_utf8()),
            '"' => {
                let body = &rest[1..];
                let close = body.find(['"', '\n']).filter(|&i| body.as_bytes()[i] == b'"');
                let close = close.ok_or_else(|| ErrorKind::OpenString.at(line))?;
                (Some(Word::Text(body[..close].to_owned())), close + 2)
            }
            c if c.is_ascii_digit() || (c == '.' && digit_at(rest, 1)) => {
                let length = number_length(rest);
                (Some(number(&rest[..length]).map_err(|kind| kind.at(line))?), length)
            }
            c if c.is_ascii_alphabetic() || c == '_' => {
                let length = rest
                    .find(|c: char| !(c.is_ascii_alphanumeric() || c == '_'))
                    .unwrap_or(rest.len());
                if &rest[..length] == "p" && rest[length..].starts_with('[') {
                    brackets += 1;
                    (Some(Word::PoseOpen), 2)
                } else {
                    (Some(Word::Name(rest[..length].to_owned())), length)
                }
            }
            c => {
                let sign = SIGNS.iter().find(|sign| rest.starts_with(**sign));
                let sign = sign.ok_or_else(|| ErrorKind::Character(c).at(line))?;
                match *sign {
                    "(" | "[" => brackets += 1,
                    ")" | "]" => brackets = brackets.saturating_sub(1),
                    _ => {}
                }
                (Some(Word::Sign(sign)), sign.len())
            }
        };
        tokens.extend(word.map(|word| Token { word, line }));
        line += u32::from(first == '\n');
        rest = &rest[length..];
    }
    tokens.push(Token { word: Word::End, line });
    Ok(tokens)
}

fn digit_at(text: &str, index: usize) -> bool {
    text.as_bytes().get(index).is_some_and(u8::is_ascii_digit)
}

/// Bytes of the number that `text` starts with: digits, one point, an exponent; or `0x…`.
fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    if text.starts_with("0x") || text.starts_with("0X") {
        return 2 + bytes[2..].iter().take_while(|b| b.is_ascii_hexdigit()).count();
    }
    let digits = |from: usize| bytes[from..].iter().take_while(|b| b.is_ascii_digit()).count();
    let mut length = digits(0);
    if bytes.get(length) == Some(&b'.') {
        length += 1 + digits(length + 1);
    }
    if matches!(bytes.get(length), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(length + 1), Some(b'+' | b'-')));
        if digit_at(text, length + 1 + sign) {
            length += 1 + sign + digits(length + 1 + sign);
        }
    }
    length
}

fn number(text: &str) -> Result<Word, ErrorKind> {
    let none = || ErrorKind::Number(text.to_owned());
    if let Some(hex) = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        return u32::from_str_radix(hex, 16).map(|n| Word::Int(n.cast_signed())).or(Err(none()));
    }
    if text.contains(['.', 'e', 'E']) {
        return text.parse().ok().filter(|x: &f64| x.is_finite()).map(Word::Float).ok_or_else(none);
    }
    text.parse().map(Word::Int).or(Err(none()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> Vec<Word> {
        lex(text).unwrap().into_iter().map(|t| t.word).collect()
    }

    #[test]
    fn numbers_strings_and_signs() {
        use Word::{End, Float, Int, Name, PoseOpen, Sign, Text};
        assert_eq!(
            words("x<=.5e-1 # rest\t\n"),
            [Name("x".into()), Sign("<="), Float(0.05), Word::Newline, End]
        );
        assert_eq!(words("0xff 7 1. 2e3"), [Int(255), Int(7), Float(1.0), Float(2000.0), End]);
        assert_eq!(
            words("p[1] \"a # b\""),
            [PoseOpen, Int(1), Sign("]"), Text("a # b".into()), End]
        );
        assert_eq!(words("pp[")[0], Name("pp".into()));
    }

    #[test]
    fn brackets_carry_a_statement_over_lines() {
        let tokens = lex("a = [1,\n  2]\nb").unwrap();
        assert_eq!(tokens.iter().filter(|t| t.word == Word::Newline).count(), 1);
        assert_eq!(tokens[tokens.len() - 2], Token { word: Word::Name("b".into()), line: 3 });
    }

    #[test]
    fn errors_name_the_line() {
        for (text, error) in [
            ("\n$", "line 2: unexpected character '$'"),
            ("\"abc\n\"", "line 1: the string is not closed on its line"),
            ("x = 3000000000", "line 1: 3000000000 is no number: integers have 32 bits"),
            ("x = 1e999", "line 1: 1e999 is no number: integers have 32 bits"),
        ] {
            assert_eq!(lex(text).unwrap_err().to_string(), error);
        }
    }
}
