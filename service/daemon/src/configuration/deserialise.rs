//! From parsed TOML to the sections of [`super::schema`], with the place of every refusal.
//!
//! The deserialiser of the `toml` crate stops at the first mistake and forgets which keys are known. This one
//! notes a mistake, leaves its key out and goes on, so that one run shows as many mistakes as possible.

use super::locate::Mistakes;
use super::refusal::{Refusal, What};
use serde::de::value::StrDeserializer;
use serde::de::{DeserializeOwned, DeserializeSeed, Error, IntoDeserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserializer, forward_to_deserialize_any};
use std::cell::Cell;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Reads a table found at the dotted path `path`, as if `skip` (keys of this table) were not there.
///
/// Every mistake goes into `mistakes`; `None` if nothing could be read because of them.
pub(super) fn read<T: DeserializeOwned>(
    table: &DeTable<'_>,
    span: Range<usize>,
    path: &str,
    skip: &[String],
    mistakes: &mut Mistakes<'_>,
) -> Option<T> {
    let mut skipped: Vec<String> = skip.iter().map(|key| format!("{path}.{key}")).collect();
    loop {
        let reader = TableReader {
            table,
            path,
            skipped: &skipped,
        };
        let refusal = match T::deserialize(reader) {
            Ok(section) => return Some(section),
            Err(refusal) => refusal.at(Some(path), span.clone()),
        };
        let place = refusal.path.clone().unwrap_or_default();
        if let What::MissingKey(key) = refusal.what
            && skipped.contains(&format!("{place}.{key}"))
        {
            return None;
        }
        let (message, help) = refusal.explain();
        mistakes.at_span(refusal.span.clone().unwrap_or_default(), message, help);
        if place == path || skipped.contains(&place) {
            return None;
        }
        skipped.push(place);
    }
}

/// The keys of a section.
pub(super) fn keys_of<T: DeserializeOwned>() -> &'static [&'static str] {
    let keys = Cell::new(&[][..]);
    // The catcher answers with an error once it has seen the keys.
    let _ = T::deserialize(KeyCatcher(&keys));
    keys.get()
}

struct KeyCatcher<'a>(&'a Cell<&'static [&'static str]>);

impl<'de> Deserializer<'de> for KeyCatcher<'_> {
    type Error = Refusal;

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Refusal> {
        self.0.set(fields);
        self.deserialize_any(visitor)
    }

    fn deserialize_any<V: Visitor<'de>>(self, _visitor: V) -> Result<V::Value, Refusal> {
        Err(Refusal::custom("only the keys are asked for"))
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit
        unit_struct newtype_struct seq tuple tuple_struct map enum identifier ignored_any
    }
}

#[derive(Clone, Copy)]
struct TableReader<'a, 't> {
    table: &'a DeTable<'t>,
    path: &'a str,
    skipped: &'a [String],
}

impl<'de> Deserializer<'de> for TableReader<'_, '_> {
    type Error = Refusal;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        visitor.visit_map(TableEntries {
            reader: self,
            entries: self.table.iter(),
            value: None,
        })
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit
        unit_struct newtype_struct seq tuple tuple_struct map struct enum identifier ignored_any
    }
}

struct TableEntries<'a, 't, I> {
    reader: TableReader<'a, 't>,
    entries: I,
    value: Option<(String, &'a Spanned<DeValue<'t>>)>,
}

type Entry<'a, 't> = (&'a Spanned<toml::de::DeString<'t>>, &'a Spanned<DeValue<'t>>);

impl<'de, 'a, 't: 'a, I: Iterator<Item = Entry<'a, 't>>> MapAccess<'de> for TableEntries<'a, 't, I> {
    type Error = Refusal;

    fn next_key_seed<K: DeserializeSeed<'de>>(&mut self, seed: K) -> Result<Option<K::Value>, Refusal> {
        let TableReader { path, skipped, .. } = self.reader;
        for (key, value) in self.entries.by_ref() {
            let path = format!("{path}.{}", key.get_ref());
            if skipped.contains(&path) {
                continue;
            }
            let name: StrDeserializer<'_, Refusal> = key.get_ref().as_ref().into_deserializer();
            let name = seed
                .deserialize(name)
                .map_err(|refusal| refusal.at(Some(&path), key.span()))?;
            self.value = Some((path, value));
            return Ok(Some(name));
        }
        Ok(None)
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, Refusal> {
        let (path, value) = self
            .value
            .take()
            .ok_or_else(|| Refusal::custom("a value without its key"))?;
        let reader = ValueReader {
            value,
            path: &path,
            skipped: self.reader.skipped,
        };
        seed.deserialize(reader)
            .map_err(|refusal| refusal.at(Some(&path), value.span()))
    }
}

#[derive(Clone, Copy)]
struct ValueReader<'a, 't> {
    value: &'a Spanned<DeValue<'t>>,
    path: &'a str,
    skipped: &'a [String],
}

impl<'de> Deserializer<'de> for ValueReader<'_, '_> {
    type Error = Refusal;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        let result = match self.value.get_ref() {
            DeValue::String(text) => visitor.visit_str(text),
            DeValue::Boolean(value) => visitor.visit_bool(*value),
            DeValue::Datetime(_) => Err(Refusal::custom(
                "a date or time has no meaning here; write it as text or number",
            )),
            DeValue::Integer(number) => match i64::from_str_radix(number.as_str(), number.radix()) {
                Ok(number) => visitor.visit_i64(number),
                Err(_) => Err(Refusal::custom(format!(
                    "{number} does not fit into 64 bits; write a smaller number"
                ))),
            },
            DeValue::Float(number) => match number.as_str().parse::<f64>() {
                Ok(number) if number.is_finite() => visitor.visit_f64(number),
                _ => Err(Refusal::custom(format!(
                    "{number} is not a finite number; write a finite one"
                ))),
            },
            DeValue::Table(table) => TableReader {
                table,
                path: self.path,
                skipped: self.skipped,
            }
            .deserialize_any(visitor),
            DeValue::Array(array) => visitor.visit_seq(Elements {
                array: array.iter(),
                path: self.path,
                skipped: self.skipped,
            }),
        };
        result.map_err(|refusal| refusal.at(None, self.value.span()))
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        visitor: V,
    ) -> Result<V::Value, Refusal> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _name: &'static str,
        _variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Refusal> {
        match self.value.get_ref() {
            DeValue::String(word) => visitor.visit_enum(word.as_ref().into_deserializer()),
            other => Err(Refusal::custom(format!(
                "expected a string, found {}",
                other.type_str()
            ))),
        }
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit
        unit_struct seq tuple tuple_struct map struct identifier ignored_any
    }
}

struct Elements<'a, I> {
    array: I,
    path: &'a str,
    skipped: &'a [String],
}

impl<'de, 'a, 't: 'a, I: Iterator<Item = &'a Spanned<DeValue<'t>>>> SeqAccess<'de> for Elements<'a, I> {
    type Error = Refusal;

    fn next_element_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<Option<T::Value>, Refusal> {
        let Some(value) = self.array.next() else {
            return Ok(None);
        };
        let reader = ValueReader {
            value,
            path: self.path,
            skipped: self.skipped,
        };
        seed.deserialize(reader)
            .map(Some)
            .map_err(|refusal| refusal.at(None, value.span()))
    }
}
