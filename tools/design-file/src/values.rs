//! Values that may be written in more than one way.
#![expect(
    clippy::exhaustive_enums,
    reason = "the ways to write a value in a design file"
)]

use crate::check::{self, ValueError};
use crate::{sentence, suggest};
use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Visitor};
use std::fmt;

/// One number for every channel, or a list with one for each.
#[derive(Clone, Debug, PartialEq)]
pub enum NumberOrList {
    /// The same for all.
    Number(f64),
    /// One each.
    List(Vec<f64>),
}

impl NumberOrList {
    /// One value per channel.
    ///
    /// # Errors
    /// A list with another length.
    pub fn spread(&self, channels: usize) -> Result<Vec<f64>, ValueError> {
        match self {
            Self::Number(value) => Ok(vec![*value; channels]),
            Self::List(values) if values.len() == channels => Ok(values.clone()),
            Self::List(values) => Err(ValueError::Entries {
                found: values.len(),
                needed: channels,
            }),
        }
    }
}

impl<'de> Deserialize<'de> for NumberOrList {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = NumberOrList;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number or a list of numbers")
            }
            fn visit_f64<E: Error>(self, value: f64) -> Result<NumberOrList, E> {
                Ok(NumberOrList::Number(value))
            }
            fn visit_i64<E: Error>(self, value: i64) -> Result<NumberOrList, E> {
                Ok(NumberOrList::Number(value as f64))
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<NumberOrList, A::Error> {
                let mut values = Vec::new();
                while let Some(value) = list.next_element()? {
                    values.push(value);
                }
                Ok(NumberOrList::List(values))
            }
        }
        deserializer.deserialize_any(Either)
    }
}

/// One of several things, by its number from 1 or by its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Which {
    /// The number.
    Number(i64),
    /// The name.
    Name(String),
}

impl Which {
    /// Its index from 0 among things of these names.
    ///
    /// # Errors
    /// A number or name of nothing, or a name of more than one; `things` is what they are called.
    pub fn index(&self, names: &[&str], things: &str) -> Result<usize, ValueError> {
        let name = match self {
            Self::Number(number) => return check::index(*number, names.len(), things),
            Self::Name(name) => name,
        };
        let mut places = (0..names.len()).filter(|&at| names[at] == name);
        match (places.next(), places.next()) {
            (Some(at), None) => Ok(at),
            (Some(_), Some(_)) => Err(ValueError::SharedName {
                name: name.clone(),
                things: things.to_string(),
                total: names.len(),
            }),
            (None, _) => Err(ValueError::NoSuchName {
                name: name.clone(),
                things: things.to_string(),
                advice: suggest::nearest(name, names),
            }),
        }
    }
}

impl fmt::Display for Which {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => write!(f, "{number}"),
            Self::Name(name) => write!(f, "\"{}\"", sentence::shorten(name)),
        }
    }
}

impl<'de> Deserialize<'de> for Which {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl Visitor<'_> for Either {
            type Value = Which;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a whole number, counted from 1, or a name")
            }
            fn visit_i64<E: Error>(self, number: i64) -> Result<Which, E> {
                Ok(Which::Number(number))
            }
            fn visit_str<E: Error>(self, name: &str) -> Result<Which, E> {
                Ok(Which::Name(name.to_string()))
            }
        }
        deserializer.deserialize_any(Either)
    }
}

/// One name, or a list with one for each mode.
#[derive(Clone, Debug, PartialEq)]
pub enum NameOrList {
    /// One for all.
    Name(String),
    /// One each.
    List(Vec<String>),
}

impl NameOrList {
    /// The name for a mode (0-based); empty where the list is too short.
    pub fn of_mode(&self, mode: usize) -> &str {
        match self {
            Self::Name(name) => name,
            Self::List(names) => names.get(mode).map_or("", String::as_str),
        }
    }
}

impl<'de> Deserialize<'de> for NameOrList {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = NameOrList;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a text or a list of texts")
            }
            fn visit_str<E: Error>(self, name: &str) -> Result<NameOrList, E> {
                Ok(NameOrList::Name(name.to_string()))
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<NameOrList, A::Error> {
                let mut names = Vec::new();
                while let Some(name) = list.next_element()? {
                    names.push(name);
                }
                Ok(NameOrList::List(names))
            }
        }
        deserializer.deserialize_any(Either)
    }
}

/// A matrix as its rows, or the name of a variable in a file.
#[derive(Clone, Debug, PartialEq)]
pub enum Matrix {
    /// Its rows.
    Rows(Vec<Vec<f64>>),
    /// Where it is.
    Name(String),
}

impl<'de> Deserialize<'de> for Matrix {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = Matrix;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list of rows, or the name of a variable in file")
            }
            fn visit_str<E: Error>(self, name: &str) -> Result<Matrix, E> {
                Ok(Matrix::Name(name.to_string()))
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Matrix, A::Error> {
                let mut rows = Vec::new();
                while let Some(row) = list.next_element()? {
                    rows.push(row);
                }
                Ok(Matrix::Rows(rows))
            }
        }
        deserializer.deserialize_any(Either)
    }
}
