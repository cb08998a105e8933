//! A wall around one session's work: what breaks inside ends that session, and nothing else.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Does `work`; a panic or an error comes back as a sentence.
pub(super) fn guarded<T, E: std::fmt::Display>(work: impl FnOnce() -> Result<T, E>) -> Result<T, String> {
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(error)) => Err(error.to_string()),
        Err(panic) => Err(words(&*panic)),
    }
}

fn words(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied().or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    text.unwrap_or("a panic without words").to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_comes_back_as_its_words() {
        let number = 7;
        assert_eq!(guarded(|| -> Result<(), String> { panic!("lost {number}") }), Err("lost 7".to_owned()));
        assert_eq!(guarded(|| -> Result<(), String> { panic!("lost") }), Err("lost".to_owned()));
    }

    #[test]
    fn an_error_and_a_value_pass_through() {
        assert_eq!(guarded(|| Err::<(), _>("the device is out of memory")), Err("the device is out of memory".to_owned()));
        assert_eq!(guarded(|| Ok::<_, String>(3)), Ok(3));
    }
}
