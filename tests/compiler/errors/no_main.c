// error: there is no function 'main'
char n;
void start(void) { n = 1; }
