//! Rust sources, split into tokens.

use proc_macro2::{Delimiter, Spacing, TokenStream, TokenTree};

/// A word, a mark of Rust's grammar, or a literal as it is written; `::` is one mark.
pub type Token = String;

/// Those of a source file; a comment that documents is an attribute `doc`.
pub fn tokens(text: &str) -> Vec<Token> {
    let stream: TokenStream = text.parse().expect("the compiler takes it");
    let mut found = Vec::new();
    flatten(stream, &mut found);
    found
}

fn flatten(stream: TokenStream, found: &mut Vec<Token>) {
    let mut trees = stream.into_iter().peekable();
    while let Some(tree) = trees.next() {
        match tree {
            TokenTree::Group(group) => {
                let (open, close) = match group.delimiter() {
                    Delimiter::Brace => ("{", "}"),
                    Delimiter::Bracket => ("[", "]"),
                    Delimiter::Parenthesis => ("(", ")"),
                    Delimiter::None => ("", ""),
                };
                found.push(open.into());
                flatten(group.stream(), found);
                found.push(close.into());
            }
            TokenTree::Ident(word) => found.push(word.to_string()),
            TokenTree::Punct(mark) => {
                let colon = |tree: &TokenTree| matches!(tree, TokenTree::Punct(mark) if mark.as_char() == ':');
                let joined = mark.as_char() == ':' && mark.spacing() == Spacing::Joint;
                match joined && trees.next_if(colon).is_some() {
                    true => found.push("::".into()),
                    false => found.push(mark.as_char().into()),
                }
            }
            TokenTree::Literal(literal) => found.push(literal.to_string()),
        }
    }
}

/// The end of a group whose opening mark stands at `at`.
pub fn group_end(tokens: &[Token], at: usize) -> usize {
    let mut depth = 0;
    for (end, token) in tokens.iter().enumerate().skip(at) {
        match token.as_str() {
            "{" | "(" | "[" => depth += 1,
            "}" | ")" | "]" => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return end + 1;
        }
    }
    tokens.len()
}

/// The end of an item that begins at `at`, its attributes included.
fn item_end(tokens: &[Token], mut at: usize) -> usize {
    while at < tokens.len() {
        match tokens[at].as_str() {
            "{" => return group_end(tokens, at),
            ";" => return at + 1,
            "(" | "[" => at = group_end(tokens, at),
            _ => at += 1,
        }
    }
    at
}

/// Leaves out every item that only tests are built with.
pub fn without_tests(tokens: Vec<Token>) -> Vec<Token> {
    let (mut kept, mut at) = (Vec::new(), 0);
    while at < tokens.len() {
        if tokens[at] == "#" && tokens.get(at + 1).is_some_and(|t| t == "[") {
            let end = group_end(&tokens, at + 1);
            let inside = &tokens[at + 2..end - 1];
            let cfg = inside.first().is_some_and(|t| t == "cfg");
            let not = inside.iter().any(|t| t == "not");
            if cfg && !not && inside.iter().any(|t| t == "test") {
                at = item_end(&tokens, end);
                continue;
            }
            kept.extend_from_slice(&tokens[at..end]);
            at = end;
            continue;
        }
        kept.push(tokens[at].clone());
        at += 1;
    }
    kept
}
